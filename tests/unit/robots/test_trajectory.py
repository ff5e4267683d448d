"""A trajectory has a motion for each of its joints, whoever made it."""

from dataclasses import replace

import numpy as np
import pytest

from throwcollect.robots.trajectory import JointTrajectory

ZEROS = np.zeros((3, 2))
RIGHT = JointTrajectory(("hip", "knee"), np.arange(3.0), ZEROS, ZEROS, ZEROS)


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"positions": ZEROS[1:]}, r"positions of a trajectory should be finite numbers of the shape \(3, 2\)"),
        ({"accelerations": ZEROS * np.nan}, "accelerations of a trajectory should be finite"),
    ],
)
def test_numbers_that_are_no_motion_are_refused(change: dict[str, object], said: str) -> None:
    with pytest.raises(ValueError, match=said):
        replace(RIGHT, **change)
