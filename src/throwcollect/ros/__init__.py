"""The ROS 2 edge: what a node needs of rclpy's API, and the classes of its messages.

Nodes import from here and from nowhere below, so that they run unchanged on both backends: genuine rclpy, and the
embedded one. See `backend`.
"""

from throwcollect.ros.chosen import *  # noqa: F403
from throwcollect.ros.chosen import __all__ as __all__
