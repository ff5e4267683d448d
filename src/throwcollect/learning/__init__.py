"""Models that are learned from a dataset: where throws land, how to aim, and how another world differs."""
