"""Tasks: from the parameters of a throw to a joint trajectory, and from an episode to its outcome."""
