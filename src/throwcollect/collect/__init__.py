"""A collection from its configuration to a finished dataset: runs, runtimes, the coordinator, and clusters.

`runs` prepares, follows and ends a run; `runtimes` starts the nodes as processes or containers; `coordinator` has the
rules by which trials go to simulations and episodes to the dataset; `cluster` submits slices to a scheduler. This room
never simulates a trial and never defines a file of the dataset.
"""
