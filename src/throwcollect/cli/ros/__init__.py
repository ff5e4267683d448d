"""`throwcollect ros`: what the commands that look into the ROS graph call and print."""
