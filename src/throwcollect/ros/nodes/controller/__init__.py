"""The nodes of the controllers of one simulation."""
