"""Topics with one message a sample that are only plotted."""

from __future__ import annotations

from functools import cache

import numpy as np

from rclzenoh.interfaces import get_message
from throwcollect.episode.message_layout import MessageLayout
from throwcollect.episode.topics import Recording, Rows, Topic, put_stamps
from throwcollect.robots.limits import joint_limits
from throwcollect.robots.robot import Robot


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
        put_stamps(rows, "header.stamp", samples.stamps_ns)
        rows["position"] = (2 * samples.position[:, columns] - lower - upper) / (upper - lower)

    return Topic("/view/limits", kind, layout, fill)
