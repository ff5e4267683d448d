"""A task of somebody else's, in a package of its own."""
