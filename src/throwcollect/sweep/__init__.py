"""The sweep: which values each trial has, frozen as a plan before anything runs."""
