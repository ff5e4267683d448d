"""Classes of actions of this process's backend: ``from throwcollect.ros.action import SimulateSteps``."""

from rclzenoh.interfaces.typed_names import ACTIONS, look_up_in
from throwcollect import ros

__getattr__ = look_up_in(ACTIONS, ros.get_action, __name__)
