"""Prepares a dataset for Foxglove, Rerun and RViz, with frames, meshes and markers, and draws animated pictures."""
