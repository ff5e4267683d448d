"""Classes of services of this process's backend: ``from throwcollect.ros.srv import SetParameters``."""

from functools import partial

from rclzenoh.interfaces.typed_names import SERVICES, look_up_in
from throwcollect.ros.backend_names import find_class

__getattr__ = look_up_in(SERVICES, partial(find_class, "srv"), __name__)
