"""A dataset made ready for Foxglove, Rerun and RViz: frames, meshes and markers beside what was recorded."""
