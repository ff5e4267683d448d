"""Classes of actions of this process's backend: ``from throwcollect.ros.action import SimulateSteps``."""

from functools import partial

from rclzenoh.interfaces.typed_names import ACTIONS, look_up_in
from throwcollect.ros.backend_names import find_class

__getattr__ = look_up_in(ACTIONS, partial(find_class, "action"), __name__)
