"""The node that lists a robot's controllers, as ros2_control's controller manager does."""

from __future__ import annotations

from throwcollect.ros import Node
from throwcollect.ros.msg import ControllerState
from throwcollect.ros.srv import ListControllers
from throwcollect.sim.controller_parameters import COMMAND_INTERFACES, state_interfaces
from throwcollect.sim.limb_controller import LimbController
from throwcollect.sim.own_time import make_own_time
from throwcollect.sim.simulation import Simulation

_TYPE = "joint_trajectory_controller/JointTrajectoryController"


class ControllerManager(Node):
    """Offers ``~/list_controllers`` in the namespace of a simulation's node."""

    def __init__(self, parent: Node, simulation: Simulation) -> None:
        super().__init__("controller_manager", namespace=parent.get_namespace(), context=parent.context)
        make_own_time(self)
        hz = simulation.config.sim.physics_hz
        self._controllers = [_describe(limb, hz) for limb in simulation.limbs.values()]
        self.create_service(ListControllers, "~/list_controllers", self._list)

    def _list(self, _request: ListControllers.Request, response: ListControllers.Response) -> ListControllers.Response:
        response.controller = self._controllers
        return response


def _describe(limb: LimbController, hz: int) -> ControllerState:
    parameters = limb.controller.parameters
    commands, states = (
        [f"{joint}/{interface}" for joint in parameters.joints for interface in interfaces]
        for interfaces in (COMMAND_INTERFACES, state_interfaces(parameters))
    )
    return ControllerState(
        name=limb.name,
        state="active",
        type=_TYPE,
        update_rate=hz,
        claimed_interfaces=commands,
        required_command_interfaces=commands,
        required_state_interfaces=states,
    )
