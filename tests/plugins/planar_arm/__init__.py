"""A robot of another package, for tests."""
