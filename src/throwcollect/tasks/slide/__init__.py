"""The task `slide`: a puck on a table is pushed to a place."""
