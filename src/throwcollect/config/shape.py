"""Puts into words what a key may hold, by the JSON Schema of the models, for messages and for the reference."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from typing import Any

from throwcollect.config.schema import Config
from throwcollect.units import unit_of_name

_MOST_DIGITS = 9
"""Most digits of an index: no list of a configuration is longer, and Python refuses numbers of thousands of digits."""

_NOUNS = {"number": "a number", "integer": "a whole number", "string": "text", "boolean": "true or false"}


@cache
def json_schema() -> dict[str, Any]:
    """JSON Schema (draft 2020-12) of a configuration file, for editors."""
    return {"$schema": "https://json-schema.org/draft/2020-12/schema", **Config.model_json_schema()}


@dataclass(frozen=True)
class ValueShape:
    """What a key may hold.

    Attributes:
        node: Part of the JSON Schema, without references.
        unit: Unit of the numbers; empty when they have none.
    """

    node: dict[str, Any]
    unit: str = ""

    @property
    def alternatives(self) -> list[ValueShape]:
        """The shapes that a union allows; only the shape itself when it is no union."""
        nodes = self.node.get("oneOf") or self.node.get("anyOf")
        if not nodes:
            return [self]
        return [each for node in nodes for each in ValueShape(_resolve(node), self.unit).alternatives]

    @property
    def keys(self) -> dict[str, ValueShape]:
        """The keys of a section and their shapes; empty when it is no section."""
        return {name: self.child(name) for shape in self.alternatives for name in shape.node.get("properties", {})}

    @property
    def refused(self) -> dict[str, str]:
        """Keys that a user may expect in a section and that it refuses, with the reason."""
        return {name: why for shape in self.alternatives for name, why in shape.node.get("refused", {}).items()}

    @property
    def choices(self) -> list[str]:
        """The words that are allowed; empty if any text is."""
        return [word for shape in self.alternatives for word in _list_words(shape.node)]

    @property
    def has_keys(self) -> bool:
        """Whether it is a section or a mapping."""
        return any(shape.node.get("type") == "object" for shape in self.alternatives)

    @property
    def maps_joints(self) -> bool:
        """Whether it is a mapping from names of joints."""
        return "propertyNames" in self.node

    def child(self, part: str | int) -> ValueShape:
        """Find the shape of the value under a key or an index; it allows anything if there should be no value."""
        for shape in self.alternatives:
            rest = shape.node.get("items" if isinstance(part, int) else "additionalProperties")
            if node := shape.node.get("properties", {}).get(part) or rest:
                # The numbers of a mapping or a list have the unit of the key that holds it, such as angles by joint.
                inherited = self.unit if node.get("type") in ("number", "array", "object") else ""
                return ValueShape(_resolve(node), node.get("unit") or unit_of_name(str(part)) or inherited)
        return ValueShape({})

    def __str__(self) -> str:
        return " or ".join(dict.fromkeys(_describe(shape) for shape in self.alternatives))


def root() -> ValueShape:
    """Make the shape of a whole configuration."""
    return ValueShape(json_schema())


def unit_of_key(key: str) -> str:
    """Find the unit of the numbers of a dotted key: the unit of its field, or else the one that the key ends with.

    Args:
        key: Dotted key, in which an index is a part of its own; a name that is no key is allowed.
    """
    return shape_of([index_or_key(part) for part in key.split(".")]).unit or unit_of_name(key)


def index_or_key(part: str) -> int | str:
    """Read a part of a dotted key where a list may be: as an index, unless no list has so many items."""
    return int(part) if part.isdecimal() and len(part) <= _MOST_DIGITS else part


def shape_of(parts: Sequence[str | int]) -> ValueShape:
    """Find the shape of the value of a key of a configuration."""
    shape = root()
    for part in parts:
        shape = shape.child(part)
    return shape


def _resolve(node: dict[str, Any]) -> dict[str, Any]:
    if "$ref" not in node:
        return node
    target = json_schema()["$defs"][node["$ref"].rpartition("/")[2]]
    # What stands beside a reference belongs to the key, such as its default, and wins.
    return {**target, **{key: value for key, value in node.items() if key != "$ref"}}


def _list_words(node: dict[str, Any]) -> list[str]:
    return [node["const"]] if "const" in node else list(node.get("enum", []))


def _describe(shape: ValueShape) -> str:
    node = shape.node
    if own := node.get("words"):
        return str(own)
    words = _list_words(node)
    if node.get("title") == "Joint":
        return "a joint's name"
    if words:
        listed = [f"'{word}'" for word in words]
        return " or ".join(listed) if len(listed) < 3 else f"one of {', '.join(listed)}"
    kind = node.get("type", "anything")
    if kind == "array":
        return f"a list of {_make_plural(str(shape.child(0)))}"
    if kind == "object":
        if required := node.get("required"):
            return "{" + ", ".join(f"{key}: …" for key in required) + "}"
        if "properties" in node:
            return "keys and values"
        names = "joint names" if shape.maps_joints else "keys"
        return f"{names}, each with {shape.child('')}"
    if kind == "null":
        return "null"
    bounds = _describe_bounds(node) or (shape.unit and "in")
    return " ".join(filter(None, [_NOUNS.get(kind, kind), bounds, shape.unit]))


def _describe_bounds(node: dict[str, Any]) -> str:
    low, above = node.get("minimum"), node.get("exclusiveMinimum")
    high, below = node.get("maximum"), node.get("exclusiveMaximum")
    if high is None and below is not None and node["type"] == "integer":
        high, below = below - 1, None
    if low is not None and high is not None:
        return f"from {low} to {high}"
    parts = [
        f"of {low} or more" if low is not None else "",
        f"above {above}" if above is not None else "",
        f"up to {high}" if high is not None else "",
        f"below {below}" if below is not None else "",
    ]
    return " and ".join(filter(None, parts))


def _make_plural(words: str) -> str:
    for one, many in (("a joint's name", "joint names"), ("a number", "numbers"), ("one of ", "")):
        if words.startswith(one):
            return many + words.removeprefix(one)
    return words
