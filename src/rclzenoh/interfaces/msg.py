"""Classes of messages by name: ``from rclzenoh.interfaces.msg import JointState``."""

from rclzenoh.interfaces.lookup import get_message
from rclzenoh.interfaces.typed_names import MESSAGES


def __getattr__(name: str) -> object:
    if name not in MESSAGES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return get_message(MESSAGES[name])
