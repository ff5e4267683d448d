"""The RMW that carries the messages of genuine rclpy."""

import os
import sys
from importlib import import_module
from pathlib import Path

import pytest

from throwcollect.ros.middleware import Middleware
from throwcollect.ros_installation import rmws, shell_rmws


def test_rclpy_uses_the_rmw_that_middleware_names() -> None:
    """Routers and keys depend on this name, but rclpy takes the RMW to which it is linked, or one loaded before."""
    assert import_module("rclpy").get_rmw_implementation_identifier() == Middleware.of_process().rmw


def test_the_rmws_of_a_shell_are_those_of_its_own_python(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PATH", os.pathsep.join([str(Path(sys.prefix, "bin")), os.environ["PATH"]]))
    assert shell_rmws() == rmws()
    assert Middleware.of_process().rmw in shell_rmws()
