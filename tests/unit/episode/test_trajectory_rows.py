from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from throwcollect.config.schema import Config
from throwcollect.episode.channels import Channels
from throwcollect.episode.message_table import ChunkEncoder
from throwcollect.episode.trajectory_rows import STAMPS, column_shapes, to_nanoseconds, trajectory_rows, view_as_bytes
from throwcollect.errors import DatasetError
from throwcollect.robots.description import full_description
from throwcollect.robots.talos import TALOS


@pytest.fixture(scope="module")
def contents(make_samples: Any) -> bytes:
    config = Config.model_validate({"name": "rows", "sweep": {"parameters": {"task.duration_s": {"min": 1, "max": 2}}}})
    return ChunkEncoder(Channels(config, full_description(config)), level=1).encode(make_samples(20))[0].contents


def test_the_columns_of_a_trajectory_hold_the_recorded_samples(contents: bytes, make_samples: Any) -> None:
    samples = make_samples(20)
    rows = trajectory_rows(contents, 20, TALOS.joints)
    for name, expected in {
        "joints_position": samples.position,
        "joints_velocity": samples.velocity,
        "joints_effort": samples.effort,
        "ball_position": samples.ball_position,
        "ball_orientation_xyzw": samples.ball_orientation_xyzw,
    }.items():
        assert rows[name].tobytes() == expected.tobytes()
        assert column_shapes(20, 32)[name] == expected.shape
    stamps = np.empty(20, np.int64)
    view_as_bytes(stamps)[:] = rows[STAMPS]
    to_nanoseconds(stamps)
    assert np.array_equal(stamps, samples.stamps_ns)


def test_the_largest_seconds_and_nanoseconds_are_converted_exactly() -> None:
    pairs = [(0, 0), (1, 999_999_999), (2**31 - 1, 999_999_999), (5, 2**31 + 1)]
    stamps = np.array(pairs, [("sec", "<i4"), ("nanosec", "<u4")]).view(np.int64).ravel().copy()
    to_nanoseconds(stamps)
    assert stamps.tolist() == [sec * 10**9 + nanosec for sec, nanosec in pairs]


@pytest.mark.parametrize("samples", [0, -1, 3, 40, 21])
def test_a_number_of_samples_other_than_the_recorded_one_is_refused(contents: bytes, samples: int) -> None:
    with pytest.raises(
        DatasetError, match=f"are not the records of {samples} samples|not one message per channel and sample"
    ):
        trajectory_rows(contents, samples, TALOS.joints)


@pytest.mark.parametrize("joints", [TALOS.joints[:-1], TALOS.joints[::-1], ("shoulder_joint", "elbow_joint")])
def test_joints_other_than_the_recorded_ones_are_refused(contents: bytes, joints: tuple[str, ...]) -> None:
    with pytest.raises(DatasetError, match="messages of /joint_states have another layout"):
        trajectory_rows(contents, 20, joints)


def test_a_changed_constant_byte_of_the_messages_is_refused(contents: bytes) -> None:
    rows = trajectory_rows(contents, 20, TALOS.joints)
    varying = {
        place
        for kind, offset in (field[:2] for field in rows.dtype.fields.values())
        for place in range(offset, offset + kind.itemsize)
    }
    width = len(contents) // 20
    refused = 0
    for position in range(width):
        changed = bytearray(contents)
        changed[position] ^= 1
        try:
            trajectory_rows(bytes(changed), 20, TALOS.joints)
        except DatasetError:
            refused += 1
            assert position not in varying
    # These bytes vary too and are not checked: number and two times of each of two records, stamp of the odometry.
    assert refused == width - len(varying) - 2 * (4 + 8 + 8) - 8
