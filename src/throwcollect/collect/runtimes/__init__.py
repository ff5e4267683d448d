"""Runtimes, which simulate the trials of a run: processes, containers, or the launcher itself."""
