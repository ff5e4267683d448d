"""The sweep: the values of each trial, frozen as a plan before anything runs."""
