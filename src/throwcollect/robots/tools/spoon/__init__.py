"""The throwing spoon."""
