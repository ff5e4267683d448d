"""The commands of `throwcollect dataset`."""
