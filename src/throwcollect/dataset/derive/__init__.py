"""Datasets made from others: each is the dataset that a collection of its list of trials would have given."""
