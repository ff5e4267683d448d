"""Classes of messages by name: ``from rclzenoh.interfaces.msg import JointState``."""

from rclzenoh.interfaces.lookup import get_message
from rclzenoh.interfaces.typed_names import MESSAGES, look_up_in

__getattr__ = look_up_in(MESSAGES, get_message, __name__)
