"""Converts values to YAML and back, in the form of the `ros2` command."""

from __future__ import annotations

import io
from typing import Any

from ruamel.yaml import YAML
from ruamel.yaml.error import YAMLError

from throwcollect.errors import ConfigError

_SHORT = 128
"""Length at which texts and arrays are cut off, unless the user asks for all of them."""


def parse(text: str, what: str) -> Any:
    """Read a value from YAML, which is the argument `what` of a command."""
    try:
        return YAML(typ="safe", pure=True).load(text)
    except (YAMLError, ValueError) as error:
        raise ConfigError(f"{what}: not YAML: {str(error).splitlines()[0]}, got {text!r:.80}") from error


def shorten(value: Any) -> Any:
    """Cut off the texts and lists in a value that are longer than 128."""
    if isinstance(value, dict):
        return {name: shorten(each) for name, each in value.items()}
    if isinstance(value, list):
        items = [shorten(each) for each in value[:_SHORT]]
        return items if len(items) == len(value) else [*items, "..."]
    return f"{value[:_SHORT]}..." if isinstance(value, str) and len(value) > _SHORT else value


def yaml_text(value: Any) -> str:
    """Write a value as YAML, in block style, with its fields in their order."""
    writer = YAML(typ="safe", pure=True)
    writer.default_flow_style = False
    writer.allow_unicode = True
    writer.width = 1 << 30
    writer.sort_base_mapping_type_on_output = False  # type: ignore[assignment]
    stream = io.StringIO()
    writer.dump(value, stream)
    text = stream.getvalue()
    # ruamel.yaml ends a document that is a single scalar with this line; `ros2` does not.
    return text.removesuffix("...\n") if text.endswith("\n...\n") else text
