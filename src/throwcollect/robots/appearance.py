"""Compares robot descriptions, because only the appearance of a robot may change while it is simulated."""

from __future__ import annotations

from pathlib import Path

from throwcollect.errors import ConfigError, ConflictError
from throwcollect.robots.urdf import parse_xml, read_urdf

_NAME = "robot_description"


def check_appearance(description: str, drawn: str) -> None:
    """Refuse a URDF for viewers that changes more of the simulated robot's description than its appearance."""
    own, other = (read_urdf(parse_xml(text, _NAME), _NAME) for text in (description, drawn))
    if (own.links, own.joints) != (other.links, other.joints):
        raise ConflictError(
            "robot_description: may differ only in what is seen",
            hint="other joints, masses or collision shapes are another configuration",
        )


def read_urdf_text(path: Path) -> str:
    """Read the URDF text of a file."""
    try:
        text = path.read_text(encoding="utf-8")
    except OSError as error:
        raise ConfigError(f"{path}: cannot be read: {error.strerror}") from error
    except UnicodeDecodeError as error:
        raise ConfigError(f"{path}: should be a URDF, in UTF-8") from error
    if (root := parse_xml(text, str(path))).tag != "robot":
        raise ConfigError(f"{path}: should be a URDF, with robot as its root, got {root.tag}")
    return text
