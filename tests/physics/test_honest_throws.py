"""Balls of all settings fly as `dataset verify` expects where nothing touches them."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from throwcollect.collect.coordinator.prepare import draw_plan
from throwcollect.config.schema import Config
from throwcollect.dataset.verify_recording import find_flight_problems
from throwcollect.sim.simulator import Simulator

ALL_TOPICS = ["joint_states", "ball/odometry", "controller_state", "tf", "clock"]
GENTLE = {"task.duration_s": 2.0, "task.end.arm_right_4_joint": -1.6}
EARLY_STOP = {"task.start.arm_right_7_joint": 0.3, "task.end.arm_right_7_joint": -0.5, "task.duration_s": 1.3}
BACK = {"task.end.arm_right_4_joint": -1.2, "task.trajectory.gamma": 2.5, "task.duration_s": 1.0}
SETTINGS: dict[str, dict[str, Any]] = {
    "default": {},
    "drag": {"ball": {"drag_coefficient": 1.0, "mass_kg": 0.005}},
    "landing plane": {"scene": {"landing_height_m": 0.8}, "ball": {"restitution": 0.7}},
    "all topics": {"record": {"topics": ALL_TOPICS}},
    "nothing locked": {"robot": {"locked": "none"}},
    "coarse": {"sim": {"physics_hz": 100}, "record": {"rate_hz": 10}},
    "every step": {"sim": {"physics_hz": 1000, "settle_s": 0.2}, "record": {"rate_hz": 1000}},
    "steps of no whole nanoseconds": {"sim": {"physics_hz": 300}, "record": {"rate_hz": 100}},
    "not settled": {"sim": {"settle_s": 0, "command_delay_s": 0.05}},
    "weak motors": {"robot": {"position_gain_per_s": 10, "velocity_gain": 0.2}},
    "faster than planned": {"robot": {"speed_scale": 1.9}},
    "slower than planned, lagging and late": {
        "robot": {"speed_scale": 0.6, "motor_lag_s": 0.05, "joint_offsets": {"arm_right_4_joint": 0.02}},
        "sim": {"command_delay_s": 0.05},
    },
    "loose solver": {"sim": {"solver_iterations": 1}},
    "cut by the clock": {"sim": {"max_trial_s": 1.1}},
    "small ball that spins fast": {"ball": {"radius_m": 0.01, "mass_kg": 0.002, "friction": 2, "restitution": 0.9}},
    "without contacts": {"sim": {"engine": "ballistic"}, "ball": {"drag_coefficient": 0.5}},
    "without contacts, on solid ground": {"sim": {"engine": "ballistic"}, "scene": {"landing_height_m": 0.8}},
    "by MuJoCo": {"sim": {"engine": "mujoco"}},
    "by MuJoCo, with everything else": {
        "sim": {"engine": "mujoco", "settle_s": 0, "command_delay_s": 0.05, "physics_hz": 1000},
        "ball": {"drag_coefficient": 0.5, "radius_m": 0.02, "restitution": 0.6},
        "robot": {"locked": "none", "velocity_gain": 0.5},
        "scene": {"landing_height_m": 0.8},
    },
    "by MuJoCo, coarsely and with weak motors": {
        "sim": {"engine": "mujoco", "physics_hz": 100, "solver_iterations": 1},
        "record": {"rate_hz": 100},
        "robot": {"position_gain_per_s": 10, "velocity_gain": 0.2},
    },
    "slick": {"ball": {"friction": 0}, "scene": {"spoon_friction": 0}},
}


@pytest.mark.parametrize("name", SETTINGS)
def test_the_flight_of_a_simulated_throw_is_ballistic(name: str, tmp_path: Path) -> None:
    points = [{}, GENTLE] if SETTINGS[name] else [{}, GENTLE, EARLY_STOP, BACK]
    default = {"task.duration_s": 1.1, "task.end.arm_right_4_joint": -0.5, "task.trajectory.gamma": 1.2}
    default |= {"task.start.arm_right_7_joint": -0.1, "task.end.arm_right_7_joint": 0.5}
    rows = [[str({**default, **point}[key]) for key in default] for point in points]
    (tmp_path / "points.csv").write_text("\n".join(",".join(row) for row in [[*default], *rows]))
    config = Config.model_validate({**SETTINGS[name], "sweep": {"sampler": "list", "file": "points.csv"}})
    plan = draw_plan(config, directory=tmp_path)
    simulator = Simulator(config)
    run = [trial.number for trial in plan.trials if trial.refused is None]
    assert run
    for trial in run:
        planned = plan.trials[trial]
        assert list(find_flight_problems(simulator.run(planned), plan.config_of(planned))) == [], trial
