"""The API of rclpy over Zenoh, as rmw_zenoh_cpp speaks it, without a ROS installation.

`context.init` begins a session, `node` has nodes, and `interfaces` messages, services and actions. Importing this
package loads none of them.
"""
