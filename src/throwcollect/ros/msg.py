"""Classes of messages of this process's backend: ``from throwcollect.ros.msg import JointState``."""

from rclzenoh.interfaces.typed_names import MESSAGES
from throwcollect.ros.backend_names import backend_name


def __getattr__(name: str) -> object:
    if name not in MESSAGES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return backend_name("get_message")(MESSAGES[name])
