"""A format of exports: text files with commas."""
