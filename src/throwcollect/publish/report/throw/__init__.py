"""The part of a report that is on throws in particular."""
