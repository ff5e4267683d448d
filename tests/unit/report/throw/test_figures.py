"""Figures of joints have the unit of the joint."""

from __future__ import annotations

import math

import numpy as np

from throwcollect.dataset.motion import Joint
from throwcollect.report.throw.flights import draw_joint


def test_a_joint_that_slides_is_drawn_in_millimetres_and_one_that_turns_in_degrees() -> None:
    position = np.array([0.0, 0.15])
    joint = Joint("torso_lift_joint", np.array([0.0, 1.0]), position, position, position)
    for factor, unit, title in ((1000.0, " mm", "position [mm]"), (math.degrees(1), "°", "position [°]")):
        figure = draw_joint(joint, position, None, (factor, unit))
        assert figure.layout.yaxis.title.text == title
        assert np.allclose(figure.data[0].y, factor * position, rtol=1e-6)
