"""Cameras and lidars: pure functions from recorded states to pictures and ranges, with the same bits everywhere."""
