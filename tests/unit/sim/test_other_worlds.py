"""Robots that differ from their nominal model, in joint offsets, clock, motors, spoon or strength."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from throwcollect import PlanError, Simulator
from throwcollect.dataset.throw import Throw

QUICKSTART = Path(__file__).parents[3] / "configs" / "quickstart.yaml"
ELBOW = "arm_right_4_joint"


def throw(*overrides: str, feasibility: str = "nominal") -> Throw:
    with Simulator(QUICKSTART, overrides=[*overrides, f"sweep.feasibility={feasibility}"]) as simulator:
        return simulator.throw({"task.end.arm_right_4_joint": -0.6})


@pytest.fixture(scope="module")
def nominal() -> Throw:
    return throw()


def shift_m(found: Throw, nominal: Throw) -> np.ndarray:
    assert found.outcome == "landed"
    return found.events.landing.position[:2] - nominal.events.landing.position[:2]


def test_a_joint_with_an_offset_reports_the_commanded_angle(nominal: Throw) -> None:
    found = throw(f"robot.joint_offsets={{{ELBOW}: 0.06, torso_1_joint: 0.05}}")
    column = found.joints.names.index(ELBOW)
    assert found.joints.position[0, column] == pytest.approx(nominal.joints.position[0, column], abs=1e-8)
    assert found.row[f"{ELBOW}_tracking_error_rad"] < 1e-3
    assert np.linalg.norm(found.ball.position[0] - nominal.ball.position[0]) > 0.02
    x, y = shift_m(found, nominal)
    assert x > 0.01
    assert y > 0.03


def test_a_slow_clock_makes_a_motion_longer(nominal: Throw) -> None:
    found = throw("robot.speed_scale=0.9")
    column = found.joints.names.index(ELBOW)
    fastest = [float(np.abs(each.joints.velocity[:, column]).max()) for each in (nominal, found)]
    assert fastest[1] / fastest[0] == pytest.approx(0.9, abs=0.01)
    assert shift_m(found, nominal)[0] < -0.05


def test_motors_that_lag_are_late_and_arrive(nominal: Throw) -> None:
    found = throw("robot.motor_lag_s=0.03")
    column = found.joints.names.index(ELBOW)
    end = min(len(found.joints), len(nominal.joints)) - 1
    assert found.row[f"{ELBOW}_tracking_error_rad"] > 0.03
    assert found.joints.position[end, column] == pytest.approx(nominal.joints.position[end, column], abs=2e-3)


def test_a_spoon_that_sits_farther_out_throws_farther(nominal: Throw) -> None:
    assert shift_m(throw("tool.mount_offset_m=0.12"), nominal)[0] > 0.02
    with Simulator(QUICKSTART) as simulator:
        varied = simulator.throw({"task.end.arm_right_4_joint": -0.6, "tool.mount_offset_m": 0.12})
        again = simulator.throw({"task.end.arm_right_4_joint": -0.6})
    assert varied.row["landing_x_m"] == throw("tool.mount_offset_m=0.12").row["landing_x_m"]
    assert again.row["landing_x_m"] == nominal.row["landing_x_m"]


def test_a_weak_robot_throws_unless_its_actual_limits_are_checked() -> None:
    with pytest.raises(PlanError, match="its limit is"):
        throw("robot.effort_scale=0.5", feasibility="actual")
    found = throw("robot.effort_scale=0.5")
    assert found.outcome != "landed" or found.row["effort_saturated_share"] > 0
