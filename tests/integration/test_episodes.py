"""Episodes as a genuine ROS 2 subscriber receives them."""

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import pytest
import zenoh
from zenoh.ext import declare_advanced_subscriber

from rclzenoh.endpoint import unpack as unpack_attachment
from rclzenoh.interfaces import type_hash
from tests.integration.robot import ALL, CONFIG, Robot, signer
from tests.integration.test_leases import ask_for, lease
from throwcollect.episode.episode_message import unpack
from throwcollect.ros import get_message
from throwcollect.ros.middleware import Middleware

KIND = "std_msgs/msg/UInt8MultiArray"
TRIALS = 12


@contextmanager
def genuine_subscriber(endpoint: str, key: str) -> Iterator[list[Any]]:
    """What rmw_zenoh_cpp declares for a volatile subscription: it drops samples that overtake each other."""
    config = zenoh.Config()
    config.insert_json5("mode", '"client"')
    config.insert_json5("connect/endpoints", f'["{endpoint}"]')
    config.insert_json5("scouting/multicast/enabled", "false")
    config.insert_json5("timestamping/enabled", "true")
    heard: list[Any] = []
    with zenoh.open(config) as session:
        subscriber = declare_advanced_subscriber(session, key, zenoh.handlers.Callback(heard.append, indirect=False))
        yield heard
        subscriber.undeclare()


@pytest.mark.skipif(Middleware.of_process().is_fast_dds, reason="nobody is on Zenoh")
def test_a_genuine_subscriber_misses_no_episode(endpoint: str, robot: Robot) -> None:
    key = f"0/sim_0/episode/std_msgs::msg::dds_::UInt8MultiArray_/{type_hash(KIND)}"
    ours: list[bytes] = []
    subscription = robot.node.create_subscription(get_message(KIND), robot.topic("episode"), ours.append, ALL, raw=True)
    with genuine_subscriber(endpoint, key) as samples:
        assert ask_for(robot, *(lease(robot, {}, trial=number) for number in range(TRIALS))).successful
        robot.wait_until(lambda: len(samples) == len(ours) == TRIALS, "all episodes")
    robot.node.destroy_subscription(subscription)
    heard = [sample.payload.to_bytes() for sample in samples]
    assert heard == ours
    headers = [unpack(message, signer()).header for message in heard]
    assert [header.trial for header in headers] == list(range(TRIALS))
    assert [header.start_ns for header in headers] == [CONFIG.trial_start_ns(number) for number in range(TRIALS)]
    attachments = [unpack_attachment(sample.attachment) for sample in samples]
    first = attachments[0].sequence
    assert [each.sequence for each in attachments] == list(range(first, first + TRIALS))
    assert len({each.gid for each in attachments}) == 1
