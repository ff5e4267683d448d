"""A dataset made ready for Foxglove, Rerun and RViz, with frames, meshes and markers; animated pictures."""
