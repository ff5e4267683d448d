"""What carries the messages of a run."""

import os

import pytest

from throwcollect.errors import ConfigError
from throwcollect.ros.backend import RMW_VARIABLE, VARIABLE, uses_rclpy
from throwcollect.ros.middleware import Middleware, wanted

EMBEDDED, FAST_DDS = Middleware(), Middleware("rclpy", "rmw_fastrtps_cpp")
ZENOH, OTHER = Middleware("rclpy", "rmw_zenoh_cpp"), Middleware("rclpy", "rmw_cyclonedds_cpp")


@pytest.fixture(autouse=True)
def _fresh(monkeypatch):
    for variable in (VARIABLE, RMW_VARIABLE):
        # Both calls, so that whatever a test leaves there is taken away.
        monkeypatch.setenv(variable, "")
        monkeypatch.delenv(variable)
    uses_rclpy.cache_clear()
    yield
    uses_rclpy.cache_clear()


@pytest.fixture
def rclpy(monkeypatch):
    """As if rclpy with two RMWs were there."""
    monkeypatch.setattr("throwcollect.ros.backend.missing", list)
    monkeypatch.setattr("throwcollect.ros.backend.rmws", lambda: ["rmw_fastrtps_cpp", "rmw_cyclonedds_cpp"])


@pytest.mark.parametrize(
    ("middleware", "by_server", "private"),
    [(EMBEDDED, False, True), (FAST_DDS, True, False), (ZENOH, False, True), (OTHER, False, False)],
)
def test_some_find_each_other_by_a_server_and_some_keep_others_out(middleware, by_server, private):
    assert (middleware.is_fast_dds, middleware.keeps_others_out) == (by_server, private)


def test_our_own_commands_join_over_zenoh_without_rclpy():
    assert [each.joining for each in (EMBEDDED, ZENOH, FAST_DDS, OTHER)] == [EMBEDDED, EMBEDDED, FAST_DDS, OTHER]


def test_processes_are_told_the_backend_and_an_rmw_that_it_uses():
    assert EMBEDDED.environment() == {VARIABLE: "embedded"}
    assert OTHER.environment() == {VARIABLE: "rclpy", RMW_VARIABLE: "rmw_cyclonedds_cpp"}


def test_that_of_a_process_is_what_its_environment_says(rclpy, monkeypatch):
    assert Middleware.of_process() == FAST_DDS
    monkeypatch.setenv(RMW_VARIABLE, OTHER.rmw)
    assert Middleware.of_process() == OTHER
    uses_rclpy.cache_clear()
    monkeypatch.setenv(VARIABLE, "embedded")
    assert Middleware.of_process() == EMBEDDED


def test_settling_it_holds_for_the_process_and_what_it_starts(rclpy):
    assert uses_rclpy()
    EMBEDDED.settle()
    assert (uses_rclpy(), os.environ[VARIABLE]) == (False, "embedded")
    FAST_DDS.settle()
    assert (uses_rclpy(), os.environ[RMW_VARIABLE]) == (True, FAST_DDS.rmw)
    with pytest.raises(ConfigError, match="rmw_zenoh_cpp, which is not installed"):
        ZENOH.settle()


def test_a_configuration_may_leave_it_open_or_ask_for_a_backend(rclpy, monkeypatch):
    assert wanted("auto") == FAST_DDS
    assert wanted("embedded") == EMBEDDED
    monkeypatch.setattr("throwcollect.ros.backend.missing", lambda: ["rclpy"])
    with pytest.raises(ConfigError, match="THROWCOLLECT_ROS is rclpy, but Python does not find rclpy"):
        wanted("rclpy")
