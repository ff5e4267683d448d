from rclzenoh.interfaces.msg import *  # noqa: F403
