"""What a key may hold, by the JSON Schema of the models: for messages, the reference and descriptions of parameters."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from typing import Any

from throwcollect.config.schema import Config
from throwcollect.config.section import Section
from throwcollect.units import unit_of_name

_FACTS = {"minimum": "≥ ", "exclusiveMinimum": "> ", "maximum": "≤ ", "exclusiveMaximum": "< "}


@cache
def json_schema(section: type[Section]) -> dict[str, Any]:
    """JSON Schema (draft 2020-12) of a section or a whole file, for editors."""
    return {"$schema": "https://json-schema.org/draft/2020-12/schema", **section.model_json_schema()}


@dataclass(frozen=True)
class ValueShape:
    """What a key may hold.

    Attributes:
        node: Part of the JSON Schema, without references.
        section: The section to whose schema it belongs.
        unit: Unit of the numbers; empty when they have none.
    """

    node: dict[str, Any]
    section: type[Section]
    unit: str = ""

    @property
    def alternatives(self) -> list[ValueShape]:
        """The shapes that a union allows; only the shape itself when it is no union."""
        nodes = self.node.get("oneOf") or self.node.get("anyOf")
        return [each for node in nodes for each in self._make(node, self.unit).alternatives] if nodes else [self]

    @property
    def keys(self) -> dict[str, ValueShape]:
        """The keys of a section and their shapes; empty when it is no section."""
        return {name: self.child(name) for shape in self.alternatives for name in shape.node.get("properties", {})}

    @property
    def choices(self) -> list[str]:
        """The words that are allowed; empty if any string is."""
        nodes = [shape.node for shape in self.alternatives]
        return list(dict.fromkeys(word for node in nodes for word in node.get("enum", [node.get("const")]) if word))

    def child(self, *parts: str | int) -> ValueShape:
        """Find the shape of the value under keys and indices; it allows anything if there should be no value."""
        if not parts:
            return self
        part, *below = parts
        for shape in self.alternatives:
            # A mapping whose keys match a pattern has its values below this pattern.
            values = [*shape.node.get("patternProperties", {}).values(), shape.node.get("additionalProperties")]
            rest = shape.node.get("items") if isinstance(part, int) else values[0]
            if node := shape.node.get("properties", {}).get(part) or rest:
                # The numbers of a mapping or a list have the unit of the key that holds it, such as angles by joint.
                inherited = self.unit if node.get("type") in ("number", "array", "object") else ""
                return self._make(node, node.get("unit") or unit_of_name(str(part)) or inherited).child(*below)
        return ValueShape({}, self.section)

    def __str__(self) -> str:
        return " or ".join(dict.fromkeys(shape._describe() for shape in self.alternatives))

    def _make(self, node: dict[str, Any], unit: str) -> ValueShape:
        if "$ref" in node:
            # What stands next to a reference belongs to the key, such as its default, and wins.
            node = {**json_schema(self.section)["$defs"][node["$ref"].rpartition("/")[2]], **node}
        return ValueShape({key: value for key, value in node.items() if key != "$ref"}, self.section, unit)

    def _describe(self) -> str:
        if self.choices:
            return " or ".join(f"'{word}'" for word in self.choices)
        kind = str(self.node.get("type", "anything"))
        if kind == "array":
            return f"list of {self.child(0)}"
        if kind == "object" and (item := self.child("")).node:
            return f"mapping to {item}"
        if kind == "object":
            required = ", ".join(f"{key}: …" for key in self.node.get("required", ()))
            return f"{{{required}}}" if required else "keys and values"
        facts = ", ".join(f"{sign}{self.node[fact]}" for fact, sign in _FACTS.items() if fact in self.node)
        return " ".join(filter(None, [kind, facts, self.unit if kind in ("number", "integer") else ""]))


def root(section: type[Section] = Config) -> ValueShape:
    """Make the shape of a section, or of a whole configuration."""
    return ValueShape(json_schema(section), section)


def shape_of(key: str) -> ValueShape:
    """Find the shape of the value of a dotted key of a configuration, in which an index is a part of its own."""
    return root().child(*(int(part) if part.isdecimal() else part for part in key.split(".")))


def unit_of_key(key: str) -> str:
    """Find the unit of the numbers of a dotted key: the unit of its field, or else the one that the key ends with.

    A name that is no key is allowed.
    """
    return shape_of(key).unit or unit_of_name(key)
