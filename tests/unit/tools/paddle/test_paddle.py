"""The paddle, and what a tool that holds nothing says."""

from __future__ import annotations

import numpy as np
import pytest

from throwcollect.config.schema import Config
from throwcollect.errors import ConfigError
from throwcollect.robots.feasibility import Feasibility
from throwcollect.tasks.task import task_of
from throwcollect.tools.paddle.paddle import Paddle
from throwcollect.tools.paddle.paddle_config import PaddleConfig


def test_the_blade_hangs_below_the_handle_with_its_faces_along_x() -> None:
    handle, blade = Paddle(PaddleConfig(handle_length_m=0.2, blade_length_m=0.1)).boxes
    assert handle.placement.translation == pytest.approx([0, 0, -0.1])
    assert blade.placement.translation == pytest.approx([0, 0, -0.25])
    assert np.argmin(blade.size) == 0


def test_a_ball_in_a_paddle_is_refused_with_what_to_set() -> None:
    with pytest.raises(ConfigError, match="holds no object"):
        Paddle(PaddleConfig()).ball_seat(0.025)
    config = Config.model_validate({"tool": {"name": "paddle"}})
    with pytest.raises(ConfigError, match=r"tool\.name: the paddle holds no object; set `object` to a body"):
        Feasibility(config).check(config, task_of(config).trajectory())
