"""The claw: a gripper that lets go of the ball at a given time."""
