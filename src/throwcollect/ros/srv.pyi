from rclzenoh.interfaces.srv import *  # noqa: F403
