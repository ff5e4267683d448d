from __future__ import annotations

from dataclasses import fields
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from throwcollect.episode.record import Samples
from throwcollect.episode.topics import Recording, Topic, ball_odometry, joint_states, read_samples
from throwcollect.robots.talos import TALOS


def rows_of(topic: Topic, samples: Samples) -> Any:
    return topic.encode(Recording(samples, {})).view(topic.layout.dtype)[:, 0]


def test_the_recorded_twist_is_in_the_frame_of_the_ball(make_samples: Any) -> None:
    """nav_msgs/Odometry: the twist is in the frame child_frame_id."""
    samples = make_samples(40)
    rows = rows_of(ball_odometry(), samples)
    to_world = Rotation.from_quat(samples.ball_orientation_xyzw)
    assert np.allclose(to_world.apply(rows["twist.twist.linear"]), samples.ball_linear_velocity, atol=1e-14)
    assert np.allclose(to_world.apply(rows["twist.twist.angular"]), samples.ball_angular_velocity, atol=1e-14)


def test_samples_can_be_read_back_from_their_messages(make_samples: Any) -> None:
    samples = make_samples(100)
    read = read_samples(rows_of(joint_states(TALOS.joints), samples), rows_of(ball_odometry(), samples))
    for field in fields(Samples):
        sent, got = getattr(samples, field.name), getattr(read, field.name)
        if field.name in ("ball_linear_velocity", "ball_angular_velocity"):
            assert np.allclose(sent, got, rtol=0, atol=1e-14)
        else:
            assert np.array_equal(sent, got)
            assert sent.dtype == got.dtype
