"""The middleware, which carries the messages of a run."""

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
        # After both calls, monkeypatch removes the variable at the end even if the test has set it.
        monkeypatch.setenv(variable, "")
        monkeypatch.delenv(variable)
    _choose_installed.cache_clear()
    yield
    _choose_installed.cache_clear()


@pytest.fixture
def rclpy(monkeypatch):
    """Pretends that rclpy is installed with two RMWs."""
    monkeypatch.setattr("throwcollect.ros.middleware.missing", list)
    monkeypatch.setattr("throwcollect.ros.middleware.rmws", lambda: ["rmw_fastrtps_cpp", "rmw_cyclonedds_cpp"])


@pytest.mark.parametrize(
    ("middleware", "by_server", "private"),
    [(EMBEDDED, False, True), (FAST_DDS, True, False), (ZENOH, False, True), (OTHER, False, False)],
)
def test_only_fast_dds_uses_a_server_and_only_zenoh_keeps_others_out(middleware, by_server, private):
    assert (middleware.is_fast_dds, middleware.keeps_others_out) == (by_server, private)


def test_the_environment_of_a_process_names_the_backend_and_its_rmw():
    assert EMBEDDED.environment() == {VARIABLE: "embedded"}
    assert OTHER.environment() == {VARIABLE: "rclpy", RMW_VARIABLE: "rmw_cyclonedds_cpp"}


def test_settled_middleware_overrules_the_environment_without_changing_it(rclpy, monkeypatch):
    monkeypatch.setenv(VARIABLE, "embedded")
    before = dict(os.environ)
    assert not uses_rclpy()
    for middleware in (OTHER, EMBEDDED, FAST_DDS):
        middleware.settle()
        assert Middleware.of_process() == middleware
    assert dict(os.environ) == before
    with pytest.raises(ConfigError, match="rmw_zenoh_cpp, which is not installed"):
        ZENOH.settle()


def test_a_configuration_can_ask_for_a_backend_or_leave_it_open(rclpy, monkeypatch):
    assert choose_middleware("auto") == FAST_DDS
    assert choose_middleware("embedded") == EMBEDDED
    assert Middleware.of_process() == FAST_DDS
    _choose_installed.cache_clear()
    monkeypatch.setattr("throwcollect.ros.middleware.missing", lambda: ["rclpy"])
    with pytest.raises(ConfigError, match="THROWCOLLECT_ROS is rclpy, but Python does not find rclpy"):
        choose_middleware("rclpy")
