"""What carries the messages of genuine rclpy."""

from importlib import import_module

from throwcollect.ros.middleware import Middleware


def test_rclpy_uses_the_rmw_that_middleware_names() -> None:
    """Routers and keys go by that name; rclpy takes what it is linked to, or what was loaded before it."""
    assert import_module("rclpy").get_rmw_implementation_identifier() == Middleware.of_process().rmw
