"""The dataset on disk: a rosbag2 bag of MCAP files with tables beside it; written, read, checked."""
