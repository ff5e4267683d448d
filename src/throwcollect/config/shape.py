"""What a key may hold, by the JSON Schema of the models, for the reference and for descriptions of parameters."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from typing import Any

from throwcollect.config.schema import Config
from throwcollect.units import unit_of_name

_BOUNDS = {"minimum": "≥", "exclusiveMinimum": ">", "maximum": "≤", "exclusiveMaximum": "<"}


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
    def choices(self) -> list[str]:
        """The words that are allowed; empty if any text is."""
        words = [word for shape in self.alternatives for word in _list_words(shape.node)]
        return list(dict.fromkeys(words))

    def child(self, part: str | int) -> ValueShape:
        """Find the shape of the value under a key or an index; it allows anything if there should be no value."""
        for shape in self.alternatives:
            # A mapping whose keys match a pattern has its values below this pattern.
            values = [*shape.node.get("patternProperties", {}).values(), shape.node.get("additionalProperties")]
            rest = shape.node.get("items") if isinstance(part, int) else values[0]
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
    return shape_of([int(part) if part.isdecimal() else part for part in key.split(".")]).unit or unit_of_name(key)


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
    if words := _list_words(node):
        return " or ".join(f"'{word}'" for word in words)
    kind = str(node.get("type", "anything"))
    if kind == "array":
        return f"list of {shape.child(0)}"
    if kind == "object":
        if required := node.get("required"):
            return "{" + ", ".join(f"{key}: …" for key in required) + "}"
        if "properties" in node:
            return "keys and values"
        return f"mapping from {node.get('propertyNames', {}).get('words', 'key')} to {shape.child('')}"
    bounds = ", ".join(f"{sign} {node[bound]}" for bound, sign in _BOUNDS.items() if bound in node)
    return " ".join(filter(None, [kind, bounds, shape.unit if kind in ("number", "integer") else ""]))
