from __future__ import annotations

from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from throwcollect.episode.record import Samples
from throwcollect.episode.topics import Topic, odometry


def rows_of(topic: Topic, samples: Samples) -> Any:
    return topic.encode(samples, {}).view(topic.layout.dtype)[:, 0]


def test_the_recorded_twist_is_in_the_frame_of_the_ball(make_samples: Any) -> None:
    """nav_msgs/Odometry: the twist is in the frame child_frame_id."""
    samples = make_samples(40)
    rows = rows_of(odometry("ball"), samples)
    to_world = Rotation.from_quat(samples.object_orientation_xyzw)
    assert np.allclose(to_world.apply(rows["twist.twist.linear"]), samples.object_linear_velocity, atol=1e-14)
    assert np.allclose(to_world.apply(rows["twist.twist.angular"]), samples.object_angular_velocity, atol=1e-14)
