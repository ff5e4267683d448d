"""Collections as arrays of tasks that a cluster's scheduler runs."""
