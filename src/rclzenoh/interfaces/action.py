"""Classes of actions by name: ``from rclzenoh.interfaces.action import SimulateSteps``."""

from rclzenoh.interfaces.lookup import get_action
from rclzenoh.interfaces.typed_names import ACTIONS, look_up_in

__getattr__ = look_up_in(ACTIONS, get_action, __name__)
