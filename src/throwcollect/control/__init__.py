"""Joint trajectory control: the arithmetic and decisions of ros2_controllers, without ROS or physics.

A `JointTrajectoryController` is driven by a clock and measured states; it knows neither messages nor simulations.
"""
