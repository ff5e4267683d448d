"""The names of the backend that nodes run on."""

from typing import TYPE_CHECKING

from throwcollect.ros.backend import uses_rclpy

if TYPE_CHECKING or not uses_rclpy():
    from throwcollect.ros.embedded import *  # noqa: F403
    from throwcollect.ros.embedded import __all__ as __all__
else:
    from throwcollect.ros.genuine import *  # noqa: F403
    from throwcollect.ros.genuine import __all__ as __all__
