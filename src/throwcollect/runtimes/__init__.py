"""Where the trials of a run are simulated: each member of the family `runtimes` is a place of its own."""
