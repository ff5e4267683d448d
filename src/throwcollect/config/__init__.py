"""The configuration: all its keys, and how it is read and written."""
