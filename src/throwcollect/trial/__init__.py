"""The agreement of coordinator and simulation on a trial: its lease, its goals, and the conditions of its episode."""
