"""The task `throw_into`: a ball flies into a bin, perhaps over a wall, and stays there."""
