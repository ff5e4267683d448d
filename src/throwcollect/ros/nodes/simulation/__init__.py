"""The node of one simulation, with its services, its parameters and its process."""
