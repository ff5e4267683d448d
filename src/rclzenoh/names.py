"""Names of nodes, topics and services: checks that ROS allows them, and makes them absolute."""

from __future__ import annotations

import re

from rclzenoh.exceptions import NameValidationException

_PART = r"[A-Za-z_][A-Za-z0-9_]*"
_NODE = re.compile(_PART)
_ABSOLUTE = re.compile(rf"(/{_PART})+")
_EXPECTED = "expected letters, digits and underscores, not beginning with a digit"


def check_node_name(name: str) -> None:
    """Refuse a name without namespace that no node can have."""
    if not _NODE.fullmatch(name):
        raise NameValidationException(f"invalid node name {name!r}: {_EXPECTED}")


def absolute_namespace(namespace: str) -> str:
    """Namespace with its leading slash, whether it was given absolute, relative or empty."""
    absolute = "/" + namespace.removeprefix("/")
    if absolute != "/" and not _ABSOLUTE.fullmatch(absolute):
        raise NameValidationException(f"invalid namespace {namespace!r}: {_EXPECTED}, between single slashes")
    return absolute


def join(namespace: str, name: str) -> str:
    """Absolute name of ``name`` in ``namespace``."""
    return f"{namespace.removesuffix('/')}/{name}"


def resolve(name: str, namespace: str, node: str) -> str:
    """Absolute name of a topic or service that a node in a namespace calls ``/x``, ``x`` or ``~/x``."""
    if name.startswith("/"):
        absolute = name
    elif name == "~" or name.startswith("~/"):
        absolute = join(namespace, node) + name[1:]
    else:
        absolute = join(namespace, name)
    if not _ABSOLUTE.fullmatch(absolute):
        raise NameValidationException(f"invalid topic or service name {name!r}: {_EXPECTED}, between single slashes")
    return absolute
