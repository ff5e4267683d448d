"""What the hand of a robot holds, and the ball lies in."""
