"""Classes of services of this process's backend: ``from throwcollect.ros.srv import SetParameters``."""

from rclzenoh.interfaces.typed_names import SERVICES
from throwcollect.ros.backend_names import backend_name


def __getattr__(name: str) -> object:
    if name not in SERVICES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return backend_name("get_service")(SERVICES[name])
