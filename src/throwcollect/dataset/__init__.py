"""The dataset on disk: a rosbag2 bag of MCAP files with tables; written, read, checked, mended, and derived.

`writer` and `shard` write so that a crash at any moment loses no episode, `reader` and `throw` read, `verify` checks,
and `derive` makes other datasets. This room never simulates, and knows nothing of nodes.
"""
