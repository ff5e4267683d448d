"""The RMW that carries the messages of genuine rclpy."""

from importlib import import_module

from throwcollect.ros.middleware import Middleware


def test_rclpy_uses_the_rmw_that_middleware_names() -> None:
    """Routers and keys depend on this name, but rclpy takes the RMW to which it is linked, or one loaded before."""
    assert import_module("rclpy").get_rmw_implementation_identifier() == Middleware.of_process().rmw
