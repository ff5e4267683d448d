"""The numbers of a trajectory in the rows of a state chunk: every column at a constant place in every row.

One structured type, laid onto the uncompressed chunk, shows all columns without a copy, and they are gathered as runs
of bytes: a whole row of a column at a time, aligned or not.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache

import numpy as np
from numpy.typing import NDArray

from throwcollect.episode.channels import BALL_ODOMETRY_ID, JOINT_STATES_ID
from throwcollect.episode.chunk import MESSAGE_HEADER
from throwcollect.episode.message_table import FirstRow
from throwcollect.episode.topics import ball_odometry, joint_states
from throwcollect.units import NS_PER_S

STAMPS = "stamps_ns"
"""A pair of 32-bit numbers until `to_nanoseconds` makes one of it."""
JOINT_COLUMNS = ("joints.position", "joints.velocity", "joints.effort")
BALL_VELOCITIES = ("ball.velocity", "ball.angular_velocity")
"""In the frame of the ball as they are recorded."""
BALL_ORIENTATION = "ball.orientation_xyzw"

_FIELDS = {
    JOINT_STATES_ID: {
        STAMPS: "header.stamp.sec",
        **dict(zip(JOINT_COLUMNS, ("position", "velocity", "effort"), strict=True)),
    },
    BALL_ODOMETRY_ID: {
        "ball.position": "pose.pose.position",
        BALL_ORIENTATION: "pose.pose.orientation",
        BALL_VELOCITIES[0]: "twist.twist.linear",
        BALL_VELOCITIES[1]: "twist.twist.angular",
    },
}
"""Columns, and the fields of the messages that hold them."""
_STAMP_BYTES = 8


def column_shapes(samples: int, joints: int) -> Mapping[str, tuple[int, ...]]:
    """Shapes of the columns of some samples, by name.

    Args:
        samples: Number of samples.
        joints: Number of joints that the columns of joints have.
    """
    ball = dict(ball_odometry().layout.dtype.fields or {})
    return {
        STAMPS: (samples,),
        **dict.fromkeys(JOINT_COLUMNS, (samples, joints)),
        **{name: (samples, *ball[field][0].shape) for name, field in _FIELDS[BALL_ODOMETRY_ID].items()},
    }


@cache
def _fields(joints: tuple[str, ...]) -> Mapping[str, tuple[int, int]]:
    """Where each column begins in its message, and its size [bytes], by name."""
    fields = {}
    for topic, columns in zip((joint_states(joints), ball_odometry()), _FIELDS.values(), strict=True):
        places = dict(topic.layout.dtype.fields or {})
        for name, field in columns.items():
            kind, offset = places[field][:2]
            fields[name] = (offset, _STAMP_BYTES if name == STAMPS else kind.itemsize)
    return fields


@cache
def _row_type(joints: tuple[str, ...], starts: tuple[int, ...], size: int) -> np.dtype[np.void]:
    """Type of a row in which the records of joint states and odometry begin at `starts`."""
    fields = _fields(joints)
    places = {
        name: start + MESSAGE_HEADER.size + fields[name][0]
        for start, columns in zip(starts, _FIELDS.values(), strict=True)
        for name in columns
    }
    formats = [f"V{fields[name][1]}" for name in places]
    return np.dtype({"names": list(places), "formats": formats, "offsets": [*places.values()], "itemsize": size})


def trajectory_rows(contents: bytes, samples: int, joints: tuple[str, ...]) -> NDArray[np.void]:
    """Uncompressed records of a state chunk seen as a table, without a copy.

    Args:
        contents: Records that their CRC has been compared with; the first message of a channel stands for the layout
            of all.
        samples: Number of samples.
        joints: Joints that must have been recorded, in this order.

    Returns:
        Shape ``(samples,)``; the fields are the columns, as bytes.

    Raises:
        DatasetError: If they are not rows with joint states of these joints and odometry as they are written here.
    """
    row = FirstRow(contents, samples)
    for channel, topic in zip(_FIELDS, (joint_states(joints), ball_odometry()), strict=True):
        row.check_layout(channel, topic)
    starts = tuple(row.columns[channel].offset for channel in _FIELDS)
    return np.frombuffer(contents, _row_type(joints, starts, len(contents) // samples))


def view_as_bytes(array: NDArray[np.float64] | NDArray[np.int64]) -> NDArray[np.void]:
    """A contiguous array of one or two dimensions, seen as one run of bytes a row; shape ``(n,)``."""
    width = array.shape[1] if array.ndim > 1 else 1
    rows: NDArray[np.void] = array.reshape(len(array), width).view(f"V{width * array.itemsize}")[:, 0]
    return rows


def to_nanoseconds(stamps: NDArray[np.int64]) -> None:
    """Make numbers [ns] of stamps as they are recorded, in place."""
    pairs = stamps.view([("sec", "<i4"), ("nanosec", "<u4")])
    stamps[:] = pairs["sec"].astype(np.int64) * NS_PER_S + pairs["nanosec"]
