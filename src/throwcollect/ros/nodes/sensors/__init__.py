"""The node that publishes what sensors see of a running simulation."""
