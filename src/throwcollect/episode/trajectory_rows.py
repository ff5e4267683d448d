"""The numbers of a trajectory in the rows of a state chunk, where every column has a constant place in every row.

A view of the uncompressed chunk with one structured type shows all columns without a copy. A field is a run of bytes,
so that NumPy copies a whole row of a column at a time, aligned or not.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache

import numpy as np
from numpy.typing import NDArray

from throwcollect.episode.channels import BALL_ODOMETRY_ID, JOINT_STATES_ID
from throwcollect.episode.chunk import MESSAGE_HEADER
from throwcollect.episode.message_table import RowLayout
from throwcollect.episode.topics import STAMP, ball_odometry, joint_states, read_stamps

STAMPS = "stamps_ns"
"""A pair of 32-bit numbers until `to_nanoseconds` turns it into one number."""
JOINT_COLUMNS = ("joints_position", "joints_velocity", "joints_effort")
BALL_VELOCITIES = ("ball_velocity", "ball_angular_velocity")
"""These are recorded in the frame of the ball."""
BALL_ORIENTATION = "ball_orientation_xyzw"

_FIELDS = {
    JOINT_STATES_ID: {
        STAMPS: "header.stamp.sec",
        **dict(zip(JOINT_COLUMNS, ("position", "velocity", "effort"), strict=True)),
    },
    BALL_ODOMETRY_ID: {
        "ball_position": "pose.pose.position",
        BALL_ORIENTATION: "pose.pose.orientation",
        BALL_VELOCITIES[0]: "twist.twist.linear",
        BALL_VELOCITIES[1]: "twist.twist.angular",
    },
}
"""By channel: the columns, and the fields of its messages that hold them."""


def column_shapes(samples: int, joints: int) -> Mapping[str, tuple[int, ...]]:
    """List the shapes of the columns by name, for a number of samples and a number of joints."""
    ball = dict(ball_odometry().layout.dtype.fields or {})
    return {
        STAMPS: (samples,),
        **dict.fromkeys(JOINT_COLUMNS, (samples, joints)),
        **{name: (samples, *ball[field][0].shape) for name, field in _FIELDS[BALL_ODOMETRY_ID].items()},
    }


@cache
def _make_row_type(joints: tuple[str, ...], starts: tuple[int, ...], size: int) -> np.dtype[np.void]:
    """Make the type of a row of `size` bytes with the records of joint states and odometry at `starts`."""
    names, formats, offsets = [], [], []
    for topic, start, columns in zip((joint_states(joints), ball_odometry()), starts, _FIELDS.values(), strict=True):
        places = dict(topic.layout.dtype.fields or {})
        for name, field in columns.items():
            kind, offset = places[field][:2]
            names.append(name)
            # The nanoseconds lie right behind the seconds, so both are one run of bytes.
            formats.append(f"V{STAMP.itemsize if name == STAMPS else kind.itemsize}")
            offsets.append(start + MESSAGE_HEADER.size + offset)
    return np.dtype({"names": names, "formats": formats, "offsets": offsets, "itemsize": size})


def trajectory_rows(contents: bytes, samples: int, joints: tuple[str, ...]) -> NDArray[np.void]:
    """View the uncompressed records of a state chunk as a table, without a copy.

    Their CRC has been compared, so only the layout of the first message of each channel is checked.

    Returns:
        Shape ``(samples,)``; the fields are the columns, as bytes.
    """
    row = RowLayout(contents, samples)
    for channel, topic in zip(_FIELDS, (joint_states(joints), ball_odometry()), strict=True):
        row.check_topic(channel, topic)
    starts = tuple(row.columns[channel].offset for channel in _FIELDS)
    return np.frombuffer(contents, _make_row_type(joints, starts, len(contents) // samples))


def view_as_bytes(array: NDArray[np.float64] | NDArray[np.int64]) -> NDArray[np.void]:
    """View a contiguous array of one or two dimensions as one run of bytes per row, shape ``(n,)``."""
    width = array.shape[1] if array.ndim > 1 else 1
    rows: NDArray[np.void] = array.reshape(len(array), width).view(f"V{width * array.itemsize}")[:, 0]
    return rows


def to_nanoseconds(stamps: NDArray[np.int64]) -> None:
    """Turn recorded stamps into numbers [ns], in place."""
    # Both sides are the same memory, which is written only when the right side is computed.
    stamps[:] = read_stamps(stamps.view(STAMP), "stamp")
