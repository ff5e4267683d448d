"""Where the trials of a run are simulated: each member of the table in `runtime` is a place of its own."""
