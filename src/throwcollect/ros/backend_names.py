"""Finds names in the backend of this process, which is imported when the first name is needed."""

from __future__ import annotations

import sys
from importlib import import_module
from typing import Any, Literal

_EDGE = "throwcollect.ros"

Kind = Literal["msg", "srv", "action"]
"""Kind of an interface, as it stands in full names."""


def __getattr__(name: str) -> Any:
    # Python itself looks for such names in a module, and that must not load a backend.
    if name.startswith("__"):
        raise AttributeError(name)
    from throwcollect.ros.middleware import uses_rclpy

    backend = import_module(f"{_EDGE}.genuine" if uses_rclpy() else f"{_EDGE}.embedded")
    try:
        value = getattr(backend, name)
    except AttributeError:
        raise AttributeError(f"module {_EDGE!r} has no attribute {name!r}") from None
    # Python calls `__getattr__` only for names that a module does not have, so it is not called for this name again.
    setattr(sys.modules[_EDGE], name, value)
    return value


def find_class(kind: Kind, full_name: str) -> Any:
    """Class of an interface of the backend."""
    get = {"msg": "get_message", "srv": "get_service", "action": "get_action"}[kind]
    return getattr(sys.modules[_EDGE], get)(full_name)
