"""Classes of services by name: ``from rclzenoh.interfaces.srv import SetParameters``."""

from rclzenoh.interfaces.lookup import get_service
from rclzenoh.interfaces.typed_names import SERVICES, look_up_in

__getattr__ = look_up_in(SERVICES, get_service, __name__)
