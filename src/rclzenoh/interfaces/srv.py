"""Classes of services by name: ``from rclzenoh.interfaces.srv import SetParameters``."""

from rclzenoh.interfaces.lookup import get_service
from rclzenoh.interfaces.typed_names import SERVICES


def __getattr__(name: str) -> object:
    if name not in SERVICES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return get_service(SERVICES[name])
