"""Stored throws, simulated once more and compared bit for bit."""
