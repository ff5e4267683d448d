"""Parameters have the names and defaults of ros2_controllers; all wrong ones are reported at once."""

from __future__ import annotations

import math

import pytest

from throwcollect.control.parameters import Constraints, ControllerParameters, JointConstraints
from throwcollect.errors import ConfigError


def test_parameters_have_the_defaults_of_ros2_controllers() -> None:
    parameters = ControllerParameters(("j1",))
    assert not parameters.allow_partial_joints_goal
    assert not parameters.allow_nonzero_velocity_at_trajectory_end
    assert not parameters.allow_integration_in_goal_trajectories
    assert parameters.cmd_timeout == 0.0
    assert parameters.constraints == Constraints(goal_time=0.0, stopped_velocity_tolerance=0.01, joints={})
    assert not parameters.constraints.decelerate_on_cancel
    assert JointConstraints() == JointConstraints(trajectory=0.0, goal=0.0, max_deceleration_on_cancel=0.0)


WRONG = [
    ({"constraints": Constraints(goal_time=-1)}, "constraints.goal_time: must be .* at least 0.0; got -1"),
    ({"constraints": Constraints(stopped_velocity_tolerance=math.nan)}, "stopped_velocity_tolerance: .*got nan"),
    ({"cmd_timeout": -1.0}, "cmd_timeout: must be a finite number of at least 0.0; got -1.0"),
    (
        {"constraints": Constraints(joints={"a": JointConstraints(0, 0, -1)})},
        "constraints.a.max_deceleration_on_cancel",
    ),
    ({"constraints": Constraints(joints={"a": JointConstraints(-1)})}, "constraints.a.trajectory: must be"),
    ({"constraints": Constraints(joints={"a": JointConstraints(0, math.inf)})}, "constraints.a.goal: .*got inf"),
]


@pytest.mark.parametrize(("changes", "message"), WRONG)
def test_wrong_values_of_parameters_are_refused(changes: dict[str, object], message: str) -> None:
    with pytest.raises(ConfigError, match=message):
        ControllerParameters(**{"joints": ("a",), **changes})
