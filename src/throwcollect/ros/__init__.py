"""The ROS 2 edge: what a node needs of rclpy's API, and the classes of its messages.

Nodes import from here and from nowhere below, so that they run unchanged on both backends: genuine rclpy, and the
embedded one. The first name that is taken from here settles which one it is; see `backend`.
"""

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from throwcollect.ros.embedded.api import *  # noqa: F403
    from throwcollect.ros.embedded.api import __all__ as __all__
else:
    from throwcollect.ros.backend_names import __getattr__ as __getattr__
