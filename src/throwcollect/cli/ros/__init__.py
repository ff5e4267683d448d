"""The commands of `throwcollect ros`."""
