"""What carries the messages of a run."""

import os

import pytest

from throwcollect.errors import ConfigError
from throwcollect.ros.middleware import (
    RMW_VARIABLE,
    VARIABLE,
    Middleware,
    _choose_installed,
    choose_middleware,
    uses_rclpy,
)

EMBEDDED, FAST_DDS = Middleware(), Middleware("rclpy", "rmw_fastrtps_cpp")
ZENOH, OTHER = Middleware("rclpy", "rmw_zenoh_cpp"), Middleware("rclpy", "rmw_cyclonedds_cpp")


@pytest.fixture(autouse=True)
def _fresh(monkeypatch):
    for variable in (VARIABLE, RMW_VARIABLE):
        # Both calls, so that whatever a test leaves there is taken away.
        monkeypatch.setenv(variable, "")
        monkeypatch.delenv(variable)
    _choose_installed.cache_clear()
    yield
    _choose_installed.cache_clear()


@pytest.fixture
def rclpy(monkeypatch):
    """As if rclpy with two RMWs were there."""
    monkeypatch.setattr("throwcollect.ros.middleware.missing", list)
    monkeypatch.setattr("throwcollect.ros.middleware.rmws", lambda: ["rmw_fastrtps_cpp", "rmw_cyclonedds_cpp"])


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
    monkeypatch.setenv(VARIABLE, "embedded")
    assert Middleware.of_process() == EMBEDDED


def test_a_process_settles_it_whatever_its_environment_says_and_leaves_that_alone(rclpy, monkeypatch):
    monkeypatch.setenv(VARIABLE, "embedded")
    before = dict(os.environ)
    assert not uses_rclpy()
    for middleware in (OTHER, EMBEDDED, FAST_DDS):
        middleware.settle()
        assert Middleware.of_process() == middleware
    assert dict(os.environ) == before
    with pytest.raises(ConfigError, match="rmw_zenoh_cpp, which is not installed"):
        ZENOH.settle()


def test_a_configuration_may_leave_it_open_or_ask_for_a_backend(rclpy, monkeypatch):
    assert choose_middleware("auto") == FAST_DDS
    assert choose_middleware("embedded") == EMBEDDED
    assert Middleware.of_process() == FAST_DDS
    _choose_installed.cache_clear()
    monkeypatch.setattr("throwcollect.ros.middleware.missing", lambda: ["rclpy"])
    with pytest.raises(ConfigError, match="THROWCOLLECT_ROS is rclpy, but Python does not find rclpy"):
        choose_middleware("rclpy")
