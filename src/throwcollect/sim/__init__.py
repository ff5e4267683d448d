"""The simulation: a physics world, its controllers and the ROS 2 node around them."""
