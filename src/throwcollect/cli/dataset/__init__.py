"""`throwcollect dataset`: what the commands that look into datasets, and make others of them, call and print."""
