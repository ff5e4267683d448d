"""What is learned from a dataset: where throws land, how to aim at a place, and how another robot differs."""
