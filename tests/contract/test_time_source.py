"""Clocks of nodes."""

import time

from throwcollect.ros import Parameter, Time, provide_time


def test_a_node_shows_the_time_of_the_system(rig):
    assert abs(rig.node("node").get_clock().now().nanoseconds - time.time_ns()) < 5e9


def test_a_node_that_provides_its_time_shows_it_also_after_use_sim_time_is_set_to_false(rig):
    node = rig.node("node")
    provide_time(node)
    assert node.get_clock().now().nanoseconds == 0
    node.get_clock().set_ros_time_override(Time(nanoseconds=12))
    assert node.set_parameters([Parameter("use_sim_time", value=False)])[0].successful
    assert node.get_clock().now().nanoseconds == 12


def test_use_sim_time_must_be_a_bool(rig):
    node = rig.node("node")
    assert not node.set_parameters([Parameter("use_sim_time", value=1)])[0].successful
