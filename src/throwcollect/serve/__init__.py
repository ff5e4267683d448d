"""`throwcollect serve`: one process through which browsers and other programs look at runs, and act on them."""
