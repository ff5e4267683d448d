"""A task of another package, for tests."""
