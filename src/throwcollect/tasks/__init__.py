"""What a trial is for: from parameters, a file or a policy to joint motions, and from an episode to its outcome.

A task plans the motion, decides when a trial ends, judges the episode, and declares the columns of its results. This
room never sends a command and never steps a world.
"""
