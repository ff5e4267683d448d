"""Two engines, written apart from each other, simulate the same throws."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

import pytest

from throwcollect import Simulator, Throw

POINTS: list[Mapping[str, float]] = [
    {},
    {"task.end.arm_right_4_joint": -0.9, "task.duration_s": 1.2},
    {"task.end.arm_right_4_joint": -0.3, "task.end.arm_right_7_joint": 0.2, "task.duration_s": 1.05},
    {"task.end.torso_1_joint": 0.3, "task.trajectory.gamma": 1.0},
    {"task.end.torso_1_joint": -0.3, "task.trajectory.gamma": 1.25, "ball.mass_kg": 0.06},
    {"ball.drag_coefficient": 0.47, "ball.radius_m": 0.02},
]


def throws(engine: str, config: str = "quickstart", points: Sequence[Mapping[str, float]] = POINTS) -> Iterator[Throw]:
    with Simulator(f"configs/{config}.yaml", overrides=[f"sim.engine={engine}"]) as simulator:
        yield from simulator.throw_many(points)


def test_throws_of_both_engines_land_within_4_mm_of_each_other() -> None:
    for point, bullet, mujoco in zip(POINTS, throws("bullet"), throws("mujoco"), strict=True):
        one, other = bullet.row, mujoco.row
        assert one["outcome"] == other["outcome"] == "landed", point
        for key, tolerance in {
            "landing_x_m": 0.004,
            "landing_y_m": 0.004,
            "landing_time_s": 0.001,
            "release_time_s": 0.0041,
            "release_speed_mps": 0.01,
            "effort_peak_share": 0.002,
        }.items():
            assert other[key] == pytest.approx(one[key], abs=tolerance), (key, point)
        assert one["recontacts"] == other["recontacts"] == 0
        assert one["digest"] != other["digest"]


def test_balls_that_a_claw_lets_go_land_within_a_millimetre_of_each_other() -> None:
    points = [{"tool.release_s": 0.62}, {"tool.release_s": 0.7}, {"tool.release_s": 0.78, "ball.mass_kg": 0.15}]
    made = (throws(engine, "claw", points) for engine in ("bullet", "mujoco", "ballistic"))
    for point, *same in zip(points, *made, strict=True):
        for throw in same:
            assert throw.row["outcome"] == "landed"
            # The first step in which the ball is free.
            assert throw.row["release_time_s"] == pytest.approx(point["tool.release_s"] + 0.002)
            assert throw.row["landing_x_m"] == pytest.approx(same[0].row["landing_x_m"], abs=0.001)
            assert throw.row["landing_y_m"] == pytest.approx(same[0].row["landing_y_m"], abs=0.001)
