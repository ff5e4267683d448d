"""The ROS 2 edge: what a node needs of rclpy's API, and the classes of its messages.

Nodes import from here and from nowhere below, so that they run unchanged on both backends: genuine rclpy, and the
embedded one. See `backend`.
"""

from typing import TYPE_CHECKING

from throwcollect.ros.backend import uses_rclpy

if TYPE_CHECKING or not uses_rclpy():
    from throwcollect.ros.embedded import *  # noqa: F403
    from throwcollect.ros.embedded import __all__
else:
    from throwcollect.ros.genuine import *  # noqa: F403
    from throwcollect.ros.genuine import __all__  # noqa: F401
