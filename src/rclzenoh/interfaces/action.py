"""Classes of actions by name: ``from rclzenoh.interfaces.action import SimulateSteps``."""

from rclzenoh.interfaces.lookup import get_action
from rclzenoh.interfaces.typed_names import ACTIONS


def __getattr__(name: str) -> object:
    if name not in ACTIONS:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return get_action(ACTIONS[name])
