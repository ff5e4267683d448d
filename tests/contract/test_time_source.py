"""Simulated time."""

import time

import pytest

from tests.contract.rig import ON_RCLPY
from throwcollect.ros import Parameter, Time, get_message, provide_time

Clock = get_message("rosgraph_msgs/msg/Clock")


@pytest.fixture
def simulation(rig):
    publisher = rig.node("simulation").create_publisher(Clock, "/clock", 1)

    def set_time(seconds, node):
        message = Clock()
        message.clock.sec = seconds
        assert rig.spin(lambda: publisher.get_subscription_count() > 0)
        publisher.publish(message)

        def is_told() -> bool:
            # On DDS, a publisher may know of a subscription that does not know of the publisher yet.
            if ON_RCLPY:
                publisher.publish(message)
            return node.get_clock().now().nanoseconds == seconds * 10**9

        assert rig.spin(is_told)

    return set_time


def test_ros_time_is_the_system_time_unless_use_sim_time_is_set(rig, simulation):
    node = rig.node("node")
    assert abs(node.get_clock().now().nanoseconds - time.time_ns()) < 5e9
    node.set_parameters([Parameter("use_sim_time", value=True)])
    assert node.get_clock().now().nanoseconds == 0
    simulation(12, node)
    node.set_parameters([Parameter("use_sim_time", value=False)])
    assert node.get_clock().now().nanoseconds > 10**18
    assert node.count_subscribers("/clock") == 0 or rig.spin(lambda: node.count_subscribers("/clock") == 0)


def test_timers_run_on_simulated_time(rig, simulation):
    node = rig.node("node")
    node.set_parameters([Parameter("use_sim_time", value=True)])
    simulation(100, node)
    calls = []
    node.create_timer(10.0, lambda: calls.append(node.get_clock().now().nanoseconds // 10**9))
    simulation(109, node)
    rig.rest(0.05)
    assert calls == []
    simulation(110, node)
    rig.rest(0.05)
    assert calls == [110]
    # Back in time, as for a new trial: the timer starts again.
    simulation(5, node)
    rig.rest(0.05)
    simulation(15, node)
    rig.rest(0.05)
    assert calls == [110, 15]


def test_a_node_that_provides_its_time_shows_it_also_after_use_sim_time_is_set_to_false(rig):
    node = rig.node("node")
    provide_time(node)
    node.get_clock().set_ros_time_override(Time(nanoseconds=12))
    assert node.set_parameters([Parameter("use_sim_time", value=False)])[0].successful
    assert node.get_clock().now().nanoseconds == 12


def test_use_sim_time_must_be_a_bool(rig):
    node = rig.node("node")
    assert not node.set_parameters([Parameter("use_sim_time", value=1)])[0].successful
