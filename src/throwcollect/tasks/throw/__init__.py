"""The task `throw`: a ball flies out of the tool and lands."""
