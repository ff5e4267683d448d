"""The API of rclpy over Zenoh, as rmw_zenoh_cpp speaks it, without a ROS installation.

`api` has the names that nodes use, `interfaces` the messages, services and actions. Importing this package loads
neither: a health check, which needs the names of keys alone, cannot afford all that stands behind them.
"""
