"""Tools: the hand of a robot holds one, and the ball lies in it."""
