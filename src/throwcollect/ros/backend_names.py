"""The names of the backend that nodes run on, found when the first of them is asked for."""

from __future__ import annotations

import sys
from importlib import import_module
from typing import Any

_EDGE = "throwcollect.ros"


def __getattr__(name: str) -> Any:
    """A name of the backend, which `throwcollect.ros` has from then on.

    Raises:
        AttributeError: If the backend has no such name.
        ConfigError: If the environment asks for a backend that is not there.
    """
    from throwcollect.ros.backend import uses_rclpy

    if name.startswith("__"):
        raise AttributeError(name)
    backend = import_module(f"{_EDGE}.genuine" if uses_rclpy() else f"{_EDGE}.embedded.api")
    try:
        value = getattr(backend, name)
    except AttributeError:
        raise AttributeError(f"module {_EDGE!r} has no attribute {name!r}") from None
    setattr(sys.modules[_EDGE], name, value)
    return value
