"""Robots: joints, controllers, limits, and the description that the physics loads."""
