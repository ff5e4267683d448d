"""The numbers of a trajectory in the rows of a chunk: every column at a constant place in every row.

The records of joint states and of the ball's odometry come first in each row, as they have the lowest numbers of all
sampled channels. So one structured type, laid onto the uncompressed chunk, shows all columns without a copy, and they
are gathered as runs of bytes: a whole row of a column at a time, aligned or not.
"""

from __future__ import annotations

import struct
from collections.abc import Mapping
from functools import cache
from typing import NamedTuple

import numpy as np
from mcap.opcode import Opcode
from numpy.typing import NDArray

from throwcollect.episode.channels import BALL_ODOMETRY_ID, JOINT_STATES_ID
from throwcollect.episode.topics import ball_odometry, joint_states
from throwcollect.errors import DatasetError

STAMPS = "stamps_ns"
"""A pair of 32-bit numbers until `to_nanoseconds` makes one of it."""
BALL_VELOCITIES = ("ball.velocity", "ball.angular_velocity")
"""In the frame of the ball as they are recorded."""
BALL_ORIENTATION = "ball.orientation_xyzw"

_FIELDS = {
    JOINT_STATES_ID: {
        "header.stamp.sec": STAMPS,
        "position": "joints.position",
        "velocity": "joints.velocity",
        "effort": "joints.effort",
    },
    BALL_ODOMETRY_ID: {
        "header.stamp.sec": "",
        "pose.pose.position": "ball.position",
        "pose.pose.orientation": BALL_ORIENTATION,
        "twist.twist.linear": BALL_VELOCITIES[0],
        "twist.twist.angular": BALL_VELOCITIES[1],
    },
}
"""Fields of the messages in order, and the names of their columns."""
_STAMP_BYTES = 8
_MESSAGE_PREFIX = struct.Struct("<BQH")
"""Opcode, length, channel; sequence number and two times follow before the message."""
_MESSAGE_HEADER_BYTES = 31
_PREFIX_BYTES = 9
"""Opcode and length, which a record's length leaves out."""


class Place(NamedTuple):
    """Where a column lies in a row.

    Attributes:
        offset: Its first byte.
        size: Number of its bytes.
        width: How many numbers these are; 0 for a single one.
    """

    offset: int
    size: int
    width: int


class _Format(NamedTuple):
    """Attributes: places of the columns; what else a row begins with, by offset; how many bytes that all is."""

    places: Mapping[str, Place]
    constant: Mapping[int, bytes]
    size: int


@cache
def _format() -> _Format:
    places: dict[str, Place] = {}
    constant: dict[int, bytes] = {}
    start = 0
    for (channel, columns), topic in zip(_FIELDS.items(), (joint_states(), ball_odometry()), strict=True):
        template, fields = topic.layout.template, dict(topic.layout.dtype.fields or {})
        size = _MESSAGE_HEADER_BYTES + len(template)
        constant[start] = _MESSAGE_PREFIX.pack(Opcode.MESSAGE, size - _PREFIX_BYTES, channel)
        body, done = start + _MESSAGE_HEADER_BYTES, 0
        for field, column in columns.items():
            dtype, offset = fields[field][:2]
            length = _STAMP_BYTES if column in (STAMPS, "") else dtype.itemsize
            constant[body + done] = template[done:offset]
            places[column] = Place(body + offset, length, dtype.shape[0] if dtype.shape else 0)
            done = offset + length
        constant[body + done] = template[done:]
        start += size
    del places[""]
    return _Format(places, constant, start)


def places() -> Mapping[str, Place]:
    """Where each column lies in a row, by its name."""
    return _format().places


@cache
def _row_type(size: int) -> np.dtype[np.void]:
    found = _format().places
    return np.dtype(
        {
            "names": list(found),
            "formats": [f"V{place.size}" for place in found.values()],
            "offsets": [place.offset for place in found.values()],
            "itemsize": size,
        }
    )


def trajectory_rows(contents: bytes, samples: int) -> NDArray[np.void]:
    """Uncompressed records of an episode seen as a table, without a copy.

    Args:
        contents: Records that their CRC has been compared with; the first row stands for the layout of all.
        samples: Number of samples.

    Returns:
        Shape ``(samples,)``; the fields are the columns, as bytes.

    Raises:
        DatasetError: If they are not rows that begin with joint states and odometry as they are written here.
    """
    found = _format()
    size, rest = divmod(len(contents), samples) if samples > 0 else (0, 0)
    if rest or size < found.size:
        raise DatasetError(f"chunk: {len(contents)} bytes are not the records of {samples} samples")
    if any(contents[start : start + len(text)] != text for start, text in found.constant.items()):
        raise DatasetError("chunk: its records do not begin with joint states and odometry as they are written here")
    return np.frombuffer(contents, _row_type(size))


def as_bytes(array: NDArray[np.float64] | NDArray[np.int64]) -> NDArray[np.void]:
    """A contiguous array of one or two dimensions, seen as one run of bytes a row; shape ``(n,)``."""
    width = array.shape[1] if array.ndim > 1 else 1
    rows: NDArray[np.void] = array.reshape(len(array), width).view(f"V{width * array.itemsize}")[:, 0]
    return rows


def to_nanoseconds(stamps: NDArray[np.int64]) -> None:
    """Make numbers [ns] of stamps as they are recorded, in place."""
    pairs = stamps.view([("sec", "<i4"), ("nanosec", "<u4")])
    stamps[:] = pairs["sec"].astype(np.int64) * 1_000_000_000 + pairs["nanosec"]
