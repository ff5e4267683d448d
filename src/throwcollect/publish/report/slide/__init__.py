"""The part of a report that is on slides in particular."""
