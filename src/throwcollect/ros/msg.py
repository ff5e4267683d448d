"""Classes of messages of this process's backend: ``from throwcollect.ros.msg import JointState``."""

from functools import partial

from rclzenoh.interfaces.typed_names import MESSAGES, look_up_in
from throwcollect.ros.backend_names import find_class

__getattr__ = look_up_in(MESSAGES, partial(find_class, "msg"), __name__)
