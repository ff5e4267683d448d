from __future__ import annotations

import numpy as np
import pytest

from throwcollect.config.schema import Config
from throwcollect.errors import ConfigError
from throwcollect.robots.feasibility import Feasibility
from throwcollect.robots.tools.claw.claw import Claw
from throwcollect.robots.tools.claw.claw_config import ClawConfig
from throwcollect.tasks.task import task_of


@pytest.mark.parametrize("radius", [0.005, 0.025, 0.04])
def test_the_open_fingers_are_apart_from_a_ball_at_their_tips(radius: float) -> None:
    tool = Claw(ClawConfig(opening_m=0.1))
    seat = np.array(tool.ball_seat(radius))
    gaps = [
        np.linalg.norm(np.maximum(np.abs(box.placement.actInv(seat)) - np.array(box.size) / 2, 0)) for box in tool.boxes
    ]
    assert gaps[-2:] == pytest.approx([0.05, 0.05])
    assert min(gaps) > radius


@pytest.mark.parametrize("keys", [{"opening_m": 0.05}, {"finger_length_m": 0.03}])
def test_a_ball_without_room_between_the_fingers_is_refused(keys: dict[str, float]) -> None:
    with pytest.raises(ConfigError, match=r"ball\.radius_m: a ball of radius 0\.025 m has no room between the open"):
        Claw(ClawConfig(**keys)).ball_seat(0.025)


def test_a_claw_holds_the_ball_in_a_posture_in_which_a_spoon_loses_it() -> None:
    tilted = {"start": {**Config().task.start, "arm_right_5_joint": 1.2}}
    for name, reason in {"spoon": "task.start does not hold the ball", "claw": "None"}.items():
        config = Config.model_validate({"tool": {"name": name}, "task": tilted})
        assert str(Feasibility(config).check(config, task_of(config).trajectory())).startswith(reason)


def test_trials_that_differ_in_the_release_alone_share_one_body() -> None:
    early, late, other = (ClawConfig(**keys) for keys in ({"release_s": 0.5}, {"release_s": 0.7}, {"mass_kg": 0.5}))
    assert early.without_release() == late.without_release() != other.without_release()
