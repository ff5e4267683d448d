"""The ROS 2 edge: the part of rclpy's API that a node needs, and the classes of its messages.

Nodes import only from here and not from the modules below, so that they run unchanged on both backends: genuine rclpy,
and the embedded one. When the first name is taken from here, the backend is chosen; see `middleware`.
"""

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from throwcollect.ros.embedded import *  # noqa: F403
else:
    from throwcollect.ros.backend_names import __getattr__ as __getattr__
