"""Actions by the API of ``rclpy.action``."""
