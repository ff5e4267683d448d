"""The simulation: the rules of a trial on any physics engine, its controllers, and the ROS 2 node around them."""
