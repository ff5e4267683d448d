from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rosbags.highlevel import AnyReader

import throwcollect
from throwcollect.dataset.reader import Dataset
from throwcollect.episode.chunk import Chunk
from throwcollect.episode.record import EpisodeHeader, Samples


@pytest.fixture(scope="module")
def loaded(collected: Path) -> Dataset:
    return throwcollect.load(collected)


def tumbling(samples: Samples, header: EpisodeHeader) -> tuple[Samples, EpisodeHeader]:
    """The same throw with a ball that turns."""
    random = np.random.default_rng(header.trial)
    turns = random.normal(size=(len(samples), 4))
    turns /= np.linalg.norm(turns, axis=1, keepdims=True)
    spin = random.normal(size=(len(samples), 3))
    return replace(samples, object_orientation_xyzw=turns, object_angular_velocity=spin), header


@pytest.fixture(scope="module")
def tumbled(make_collection: Any, tmp_path_factory: pytest.TempPathFactory) -> Path:
    return make_collection().collect(tmp_path_factory.mktemp("tumbled") / "dataset", change=tumbling)


def rotate(quaternion: Any, vector: Any) -> np.ndarray:
    """A vector turned by the quaternion of a message, by its rotation matrix."""
    x, y, z, w = quaternion.x, quaternion.y, quaternion.z, quaternion.w
    matrix = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
    ]
    return np.array(matrix) @ [vector.x, vector.y, vector.z]


def test_a_throw_has_the_numbers_that_rosbags_reads_from_each_message(tumbled: Path) -> None:
    throw = throwcollect.load(tumbled)[4]
    window = {"start": int(throw.ball.stamps_ns[0]), "stop": int(throw.ball.stamps_ns[-1]) + 1}
    ball, joints = throw.ball, throw.joints
    seen = {"/joint_states": 0, "/ball/odometry": 0}
    with AnyReader([tumbled]) as reader:
        sampled = [connection for connection in reader.connections if connection.topic in seen]
        for connection, log_time, data in reader.messages(sampled, **window):
            message, row = reader.deserialize(data, connection.msgtype), seen[connection.topic]
            seen[connection.topic] += 1
            stamp = message.header.stamp.sec * 10**9 + message.header.stamp.nanosec
            if connection.topic == "/joint_states":
                assert message.name == list(joints.names)
                assert stamp == log_time == joints.stamps_ns[row]
                for name in ("position", "velocity", "effort"):
                    assert np.array_equal(getattr(message, name), getattr(joints, name)[row])
                continue
            assert stamp == log_time == ball.stamps_ns[row]
            point, turn = message.pose.pose.position, message.pose.pose.orientation
            assert [point.x, point.y, point.z] == ball.position[row].tolist()
            assert [turn.x, turn.y, turn.z, turn.w] == ball.orientation_xyzw[row].tolist()
            twist = message.twist.twist
            assert np.allclose(rotate(turn, twist.linear), ball.velocity[row], rtol=0, atol=1e-14)
            assert np.allclose(rotate(turn, twist.angular), ball.angular_velocity[row], rtol=0, atol=1e-14)
    assert seen == {"/joint_states": len(joints), "/ball/odometry": len(ball)}
    assert len(ball) == throw.row["samples"]


def test_times_of_a_throw_count_from_the_start_of_the_trial(loaded: Dataset) -> None:
    ball = loaded[5].ball
    assert ball.time_s[0] == 0
    assert np.allclose(ball.time_s, np.arange(len(ball)) / loaded.config.record.rate_hz, rtol=0, atol=1e-12)
    assert np.array_equal(loaded[5].joints.time_s, ball.time_s)


def test_events_of_a_throw_are_those_of_the_table(loaded: Dataset) -> None:
    throw = loaded[1]
    for name in ("release", "apex", "landing"):
        event = getattr(throw.events, name)
        assert event.time_s == throw.row[f"{name}_time_s"]
        assert event.position.tolist() == [throw.row[f"{name}_{axis}_m"] for axis in "xyz"]
        assert event.velocity.tolist() == [throw.row[f"{name}_v{axis}_mps"] for axis in "xyz"]
    (spoon,) = throw.events.contacts
    assert (spoon.body, spoon.start_s, spoon.end_s) == ("spoon", 0, 0.4)
    assert repr(throw.events).startswith("Events(release at 0.400 s, apex at ")


def test_a_throw_reads_samples_only_when_they_are_asked_for(loaded: Dataset, monkeypatch: pytest.MonkeyPatch) -> None:
    read, decompress = [], Chunk.decompress
    monkeypatch.setattr(Chunk, "decompress", lambda chunk: read.append(chunk.start_ns) or decompress(chunk))
    throws = list(loaded)
    assert repr(throws[1])
    assert throws[1].events.contacts
    assert read == []
    velocity = throws[1].ball.velocity
    assert throws[1].joints.effort.shape
    assert throws[1].ball.velocity is velocity
    assert read == [loaded.config.trial_start_ns(1)]
