from rclzenoh.interfaces.action import *  # noqa: F403
