"""Classes of services of this process's backend: ``from throwcollect.ros.srv import SetParameters``."""

from rclzenoh.interfaces.typed_names import SERVICES, look_up_in
from throwcollect import ros

__getattr__ = look_up_in(SERVICES, ros.get_service, __name__)
