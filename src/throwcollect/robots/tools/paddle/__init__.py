"""The paddle: a flat blade on a handle, which hits what lies elsewhere."""
