"""The shape of a run: every key a user may write, and how it is read."""
