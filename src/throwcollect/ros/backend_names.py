"""Finds names in the backend that nodes run on, which is imported when the first of them is asked for."""

from __future__ import annotations

import sys
from importlib import import_module
from typing import Any

_EDGE = "throwcollect.ros"


def __getattr__(name: str) -> Any:
    # Python itself asks a module for such names, which must not load a backend.
    if name.startswith("__"):
        raise AttributeError(name)
    value = backend_name(name)
    # Python asks `__getattr__` only for what a module does not have, so it does not come here for this name again.
    setattr(sys.modules[_EDGE], name, value)
    return value


def find_class(get: str, full_name: str) -> object:
    """Class of an interface of the backend; ``get`` names the function that finds it by its full name."""
    return backend_name(get)(full_name)


def backend_name(name: str) -> Any:
    """A name of the backend.

    Raises:
        AttributeError: If the backend has no such name.
        ConfigError: If the environment asks for a backend that is not there.
    """
    from throwcollect.ros.middleware import uses_rclpy

    backend = import_module(f"{_EDGE}.genuine" if uses_rclpy() else f"{_EDGE}.embedded")
    try:
        return getattr(backend, name)
    except AttributeError:
        raise AttributeError(f"module {_EDGE!r} has no attribute {name!r}") from None
