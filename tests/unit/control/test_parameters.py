"""Parameters with upstream's names and defaults; wrong ones are refused, all at once."""

from __future__ import annotations

import math

import pytest

from throwcollect.control import Constraints, ControllerParameters, JointConstraints, SpeedScaling
from throwcollect.errors import ConfigError


def test_defaults_are_those_of_ros2_controllers() -> None:
    parameters = ControllerParameters(("j1",))
    assert not parameters.allow_partial_joints_goal
    assert not parameters.allow_nonzero_velocity_at_trajectory_end
    assert parameters.set_last_command_interface_value_as_state_on_activation
    assert not parameters.allow_integration_in_goal_trajectories
    assert not parameters.interpolate_from_desired_state
    assert (parameters.cmd_timeout, parameters.speed_scaling) == (0.0, SpeedScaling(1.0))
    assert (parameters.interpolation_method, parameters.action_monitor_rate) == ("splines", 20.0)
    assert parameters.constraints == Constraints(goal_time=0.0, stopped_velocity_tolerance=0.01, joints={})
    assert not parameters.constraints.decelerate_on_cancel
    assert JointConstraints() == JointConstraints(trajectory=0.0, goal=0.0, max_deceleration_on_cancel=0.0)


def test_talos_has_a_goal_tolerance_and_no_path_tolerance() -> None:
    parameters = ControllerParameters.talos(["head_1_joint", "head_2_joint"])
    assert parameters.joints == ("head_1_joint", "head_2_joint")
    assert parameters.state_interfaces == ("position",)
    assert (parameters.constraints.goal_time, parameters.constraints.stopped_velocity_tolerance) == (0.6, 0.05)
    assert set(parameters.constraints.joints.values()) == {JointConstraints(trajectory=0.0, goal=0.02)}
    assert set(parameters.constraints.joints) == set(parameters.joints)


WRONG = [
    ({"joints": ()}, "joints: must be different names, at least one; got \\[\\]"),
    ({"joints": ("a", "a")}, "joints: must be different names"),
    ({"command_interfaces": ("velocity",)}, "command_interfaces: must be \\[position\\] or .*; got \\['velocity'\\]"),
    ({"state_interfaces": ("velocity",)}, "state_interfaces: must be \\[position\\] or \\[position, velocity\\]"),
    ({"interpolation_method": "cubic"}, "interpolation_method: must be splines or none; got 'cubic'"),
    ({"action_monitor_rate": 0.05}, "action_monitor_rate: must be a finite number of at least 0.1; got 0.05"),
    ({"constraints": Constraints(goal_time=-1)}, "constraints.goal_time: must be .* at least 0.0; got -1"),
    ({"constraints": Constraints(stopped_velocity_tolerance=math.nan)}, "stopped_velocity_tolerance: .*got nan"),
    ({"constraints": Constraints(joints={"x": JointConstraints()})}, "constraints.x: unknown joint x; known: a"),
    ({"continuous_joints": ("x",)}, "continuous_joints: unknown joint x; known: a"),
    ({"cmd_timeout": -1.0}, "cmd_timeout: must be a finite number of at least 0.0; got -1.0"),
    ({"speed_scaling": SpeedScaling(-0.5)}, "speed_scaling.initial_scaling_factor: must be .*; got -0.5"),
    (
        {"constraints": Constraints(joints={"a": JointConstraints(0, 0, -1)})},
        "constraints.a.max_deceleration_on_cancel",
    ),
    ({"constraints": Constraints(joints={"a": JointConstraints(-1)})}, "constraints.a.trajectory: must be"),
    ({"constraints": Constraints(joints={"a": JointConstraints(0, math.inf)})}, "constraints.a.goal: .*got inf"),
]


@pytest.mark.parametrize(("changes", "message"), WRONG)
def test_wrong_values_are_refused(changes: dict[str, object], message: str) -> None:
    with pytest.raises(ConfigError, match=message):
        ControllerParameters(**{"joints": ("a",), **changes})


def test_all_problems_are_told_at_once() -> None:
    with pytest.raises(ConfigError, match="interpolation_method") as error:
        ControllerParameters(("a",), interpolation_method="cubic", action_monitor_rate=0)  # type: ignore[arg-type]
    assert [problem.key for problem in error.value.problems] == ["interpolation_method", "action_monitor_rate"]
