"""The API of rclpy over Zenoh, as rmw_zenoh_cpp speaks it, without a ROS installation.

`api` has the names that nodes use, `interfaces` the messages, services and actions. Importing this package loads
neither, because a health check needs only the names of keys, and loading the rest would take it too long.
"""
