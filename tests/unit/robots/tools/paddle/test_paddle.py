"""The paddle, and what a tool that holds nothing says."""

from __future__ import annotations

import numpy as np
import pytest

from throwcollect.robots.tools.paddle.paddle import Paddle
from throwcollect.robots.tools.paddle.paddle_config import PaddleConfig


def test_the_blade_hangs_below_the_handle_with_its_faces_along_x() -> None:
    handle, blade = Paddle(PaddleConfig(handle_length_m=0.2, blade_length_m=0.1)).boxes
    assert handle.placement.translation == pytest.approx([0, 0, -0.1])
    assert blade.placement.translation == pytest.approx([0, 0, -0.25])
    assert np.argmin(blade.size) == 0
