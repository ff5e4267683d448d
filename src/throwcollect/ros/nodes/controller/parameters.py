"""The ROS parameters of a joint trajectory controller, by the names that ros2_controllers gives them."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator
from typing import Any

from throwcollect.control.parameters import ControllerParameters
from throwcollect.errors import ConfigError
from throwcollect.ros import Node, Parameter, ParameterDescriptor, SetParametersResult
from throwcollect.ros.nodes.descriptors import floating_range
from throwcollect.sim.limb_controller import LimbController
from throwcollect.sim.present_trial import PresentTrial

COMMAND_INTERFACES = ("position",)
"""Interfaces that are commanded, for every joint."""

_CHANGEABLE = {
    "allow_partial_joints_goal": "Whether goals may leave joints out",
    "allow_integration_in_goal_trajectories": "Whether points may lack positions, which are then integrated",
    "allow_nonzero_velocity_at_trajectory_end": "Whether the last point may have a velocity",
    "cmd_timeout": "How long after the end of a trajectory the joints are stopped [s]; 0 never",
}


class ControllerParameterServer:
    """Offers the parameters of a limb's controller on its node, and hands changes on.

    Changes hold for the next goal. The gains of ros2_controllers are left out, because controllers that command
    positions have none. While the simulation's trial is leased, all changes are refused.
    """

    def __init__(self, node: Node, limb: LimbController, trial: PresentTrial) -> None:
        self._node = node
        self._limb = limb
        self._trial = trial
        self._configured: dict[str, Any] = {}
        for name, value, description, read_only in _list_declared(limb.controller.parameters):
            descriptor = ParameterDescriptor(description=description, read_only=read_only)
            if isinstance(value, float):
                least = 0.1 if name == "action_monitor_rate" else 0.0
                descriptor.floating_point_range = [floating_range(least, None)]
            node.declare_parameter(name, value, descriptor)
            if not read_only:
                self._configured[name] = value
        node.add_on_set_parameters_callback(self._check)
        node.add_post_set_parameters_callback(self._apply)

    def restore(self) -> None:
        """Undo what clients have changed, so that the next trial is simulated with the configured parameters."""
        stray = {
            name: value for name, value in self._configured.items() if self._node.get_parameter(name).value != value
        }
        if stray:
            self._node.set_parameters_atomically([Parameter(name, value=value) for name, value in stray.items()])

    def _check(self, parameters: list[Parameter]) -> SetParametersResult:
        if self._trial.leased:
            return SetParametersResult(successful=False, reason=self._trial.lease_in_words)
        try:
            self._change(parameters)
        except ConfigError as error:
            return SetParametersResult(successful=False, reason=str(error))
        return SetParametersResult(successful=True)

    def _apply(self, parameters: list[Parameter]) -> None:
        self._limb.controller.parameters = self._change(parameters)

    def _change(self, changes: list[Parameter]) -> ControllerParameters:
        """Make the controller's parameters anew, with new values for some of the declared ROS parameters."""
        parameters = self._limb.controller.parameters
        constraints = parameters.constraints
        joints = dict(constraints.joints)
        own: dict[str, Any] = {}
        common: dict[str, Any] = {}
        for name, value in ((change.name, change.value) for change in changes):
            section, _, rest = name.partition(".")
            joint, _, key = rest.rpartition(".")
            if section == "constraints" and joint:
                joints[joint] = dataclasses.replace(joints[joint], **{key: value})
            elif section == "constraints":
                common[key] = value
            elif name in _CHANGEABLE:
                own[name] = value
        changed = dataclasses.replace(constraints, joints=joints, **common)
        return dataclasses.replace(parameters, **own, constraints=changed)


def state_interfaces(parameters: ControllerParameters) -> tuple[str, ...]:
    """Name the interfaces that are measured, for every joint of a controller."""
    return ("position", "velocity") if parameters.measures_velocity else ("position",)


def _list_declared(parameters: ControllerParameters) -> Iterator[tuple[str, Any, str, bool]]:
    """List name, value and description of each parameter, and whether it is read-only."""
    # Clients of ros2_controllers look for all of these, even for those that cannot be changed here or have no effect.
    yield "joints", list(parameters.joints), "Joint names of the system", True
    yield "command_interfaces", list(COMMAND_INTERFACES), "What is commanded to all joints", True
    yield "state_interfaces", list(state_interfaces(parameters)), "What is measured of all joints", True
    yield "interpolation_method", "splines", "How points are connected", True
    yield "interpolate_from_desired_state", False, "Whether trajectories begin at the last command", True
    yield "action_monitor_rate", 20.0, "Feedback messages of a goal per simulated second", True
    for name, description in _CHANGEABLE.items():
        yield name, getattr(parameters, name), description, False
    activation = "Whether activation holds the last command"
    yield "set_last_command_interface_value_as_state_on_activation", True, activation, False
    constraints = parameters.constraints
    yield "command_joints", list(parameters.joints), "Joint names to control", True
    yield "open_loop_control", False, "Old name", True
    yield "speed_scaling.initial_scaling_factor", 1.0, "Speed at the start", True
    yield "speed_scaling.state_interface", "", "Where the hardware tells its speed", True
    yield "speed_scaling.command_interface", "", "Where the hardware gets its speed", True
    yield "constraints.goal_time", constraints.goal_time, "How late a goal may be reached [s]; 0 for any time", False
    stopped = "Largest velocity at the end [rad/s]; without effect where positions alone are commanded"
    yield "constraints.stopped_velocity_tolerance", constraints.stopped_velocity_tolerance, stopped, False
    yield "constraints.decelerate_on_cancel", constraints.decelerate_on_cancel, "Whether joints brake", True
    for joint in parameters.joints:
        limits = constraints.of(joint)
        path, key = "Largest position error while moving [rad]; 0 is not checked", f"constraints.{joint}"
        yield f"{key}.trajectory", limits.trajectory, path, False
        yield f"{key}.goal", limits.goal, "Largest position error at the end [rad]; 0 is not checked", False
        yield f"{key}.max_deceleration_on_cancel", limits.max_deceleration_on_cancel, "How hard it brakes", True
