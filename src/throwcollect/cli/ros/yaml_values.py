"""Values to YAML and back, in the form of the `ros2` command."""

from __future__ import annotations

import io
from typing import Any

from ruamel.yaml import YAML
from ruamel.yaml.error import YAMLError

from throwcollect.errors import ConfigError

SHORT = 128
"""Longer texts and arrays are cut off unless wanted in full."""


def parse(text: str, what: str) -> Any:
    """Value that YAML stands for.

    Args:
        text: The YAML.
        what: What it is, for the error.

    Raises:
        ConfigError: If it is no YAML.
    """
    try:
        return YAML(typ="safe", pure=True).load(text)
    except (YAMLError, ValueError) as error:
        raise ConfigError(f"{what}: not YAML: {str(error).splitlines()[0]}, got {text!r:.80}") from error


def shorten(value: Any, longest: int) -> Any:
    """Mappings, lists and scalars with texts and lists cut off.

    Args:
        value: The value.
        longest: Length at which they are cut off.
    """
    if isinstance(value, dict):
        return {name: shorten(each, longest) for name, each in value.items()}
    if isinstance(value, list):
        items = [shorten(each, longest) for each in value[:longest]]
        return items if len(items) == len(value) else [*items, "..."]
    return f"{value[:longest]}..." if isinstance(value, str) and len(value) > longest else value


def yaml_text(value: Any) -> str:
    """YAML text, block style, with fields in their order."""
    writer = YAML(typ="safe", pure=True)
    writer.default_flow_style = False
    writer.allow_unicode = True
    writer.width = 1 << 30
    writer.sort_base_mapping_type_on_output = False  # type: ignore[assignment]
    stream = io.StringIO()
    writer.dump(value, stream)
    text = stream.getvalue()
    # After a scalar alone, a line says that the document ends.
    return text.removesuffix("...\n") if text.endswith("\n...\n") else text
