"""The node of the coordinator, with its process and its topics."""
