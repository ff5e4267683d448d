"""The node that lists a robot's controllers, as ros2_control's controller manager does."""

from __future__ import annotations

from typing import Any

from throwcollect.ros import Node, get_message, get_service
from throwcollect.sim.limb_controller import LimbController
from throwcollect.sim.simulation import Simulation

ListControllers: Any = get_service("controller_manager_msgs/srv/ListControllers")
ControllerState: Any = get_message("controller_manager_msgs/msg/ControllerState")

_TYPE = "joint_trajectory_controller/JointTrajectoryController"


class ControllerManager(Node):
    """Offers ``~/list_controllers`` in the namespace of a simulation.

    Args:
        parent: The simulation's node.
        simulation: The simulation.
    """

    def __init__(self, parent: Node, simulation: Simulation) -> None:
        super().__init__("controller_manager", namespace=parent.get_namespace(), context=parent.context)
        hz = simulation.config.sim.physics_hz
        self._controllers = [_described(limb, hz) for limb in simulation.limbs.values()]
        self.create_service(ListControllers, "~/list_controllers", self._list)

    def _list(self, _request: Any, response: Any) -> Any:
        response.controller = self._controllers
        return response


def _described(limb: LimbController, hz: int) -> Any:
    parameters = limb.controller.parameters
    commands, states = (
        [f"{joint}/{interface}" for joint in parameters.joints for interface in interfaces]
        for interfaces in (parameters.command_interfaces, parameters.state_interfaces)
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
