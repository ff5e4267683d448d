"""Classes of actions of this process's backend: ``from throwcollect.ros.action import SimulateSteps``."""

from rclzenoh.interfaces.typed_names import ACTIONS
from throwcollect.ros.backend_names import backend_name


def __getattr__(name: str) -> object:
    if name not in ACTIONS:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return backend_name("get_action")(ACTIONS[name])
