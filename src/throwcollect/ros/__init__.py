"""The ROS 2 edge: the part of rclpy's API that a node needs, and the classes of its messages.

Nodes import only from here and not from the modules below, so that they run unchanged on both backends: genuine rclpy,
and the embedded one. When the first name is taken from here, the backend is chosen; see `middleware`.
"""

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from throwcollect.ros.embedded import *  # noqa: F403
else:

    def __getattr__(name: str) -> Any:
        # Python itself looks for such names in a module, and that must not load a backend.
        if name.startswith("__"):
            raise AttributeError(name)
        from importlib import import_module

        from throwcollect.ros.middleware import uses_rclpy

        backend = import_module(f"{__name__}.{'genuine' if uses_rclpy() else 'embedded'}")
        try:
            # Python calls `__getattr__` only for names that a module does not have, so not for this name again.
            return globals().setdefault(name, getattr(backend, name))
        except AttributeError:
            raise AttributeError(f"module {__name__!r} has no attribute {name!r}") from None
