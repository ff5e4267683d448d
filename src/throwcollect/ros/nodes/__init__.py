"""The nodes of a run: each turns messages of ROS 2 into calls of code that knows no ROS."""
