"""Classes of messages of this process's backend: ``from throwcollect.ros.msg import JointState``."""

from rclzenoh.interfaces.typed_names import MESSAGES, look_up_in
from throwcollect import ros

__getattr__ = look_up_in(MESSAGES, ros.get_message, __name__)
