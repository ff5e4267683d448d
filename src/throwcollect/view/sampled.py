"""Topics with one message a sample: how they are encoded, and those that are only plotted."""

from __future__ import annotations

from functools import cache

import numpy as np
from numpy.typing import NDArray

from rclzenoh.interfaces import get_message
from throwcollect.episode.layout import MessageLayout
from throwcollect.episode.topics import Recording, Rows, Topic
from throwcollect.robots.limits import joint_limits
from throwcollect.robots.robot import Robot
from throwcollect.units import NS_PER_S


def encode_samples(topic: Topic, recording: Recording) -> NDArray[np.uint8]:
    """CDR messages of a topic, shape ``(n_samples, size)``."""
    # All messages of a topic have the same size, so one array of them is filled field by field.
    messages = np.empty((len(recording.samples), len(topic.layout.template)), np.uint8)
    messages[:] = np.frombuffer(topic.layout.template, np.uint8)
    topic.fill(messages.view(topic.layout.dtype)[:, 0], recording)
    return messages


@cache
def ball_speed() -> Topic:
    """``/view/ball_speed``: std_msgs/Float64, speed of the ball's centre [m/s]."""
    kind = "std_msgs/msg/Float64"

    def fill(rows: Rows, recording: Recording) -> None:
        rows["data"] = np.linalg.norm(recording.samples.ball_linear_velocity, axis=1)

    return Topic("/view/ball_speed", kind, MessageLayout(get_message(kind)(), ["data"]), fill)


def range_shares(robot: Robot, joints: tuple[str, ...]) -> Topic:
    """``/view/limits``: sensor_msgs/JointState whose positions are -1 at the lower limit and 1 at the upper one."""
    kind = "sensor_msgs/msg/JointState"
    columns = [robot.joints.index(joint) for joint in joints]
    message = get_message(kind)(name=list(joints), position=np.zeros(len(joints)))
    layout = MessageLayout(message, ["header.stamp.sec", "header.stamp.nanosec", "position"])

    def fill(rows: Rows, recording: Recording) -> None:
        samples, limits = recording.samples, joint_limits(robot)
        lower, upper = limits.lower[columns], limits.upper[columns]
        rows["header.stamp.sec"], rows["header.stamp.nanosec"] = np.divmod(samples.stamps_ns, NS_PER_S)
        rows["position"] = (2 * samples.position[:, columns] - lower - upper) / (upper - lower)

    return Topic("/view/limits", kind, layout, fill)
