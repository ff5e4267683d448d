"""Compares robot descriptions, because only the appearance of a robot may change while it is simulated."""

from __future__ import annotations

from pathlib import Path

from throwcollect.engines.body import BodyJoint, BodyLink
from throwcollect.errors import ConfigError, ConflictError
from throwcollect.robots.urdf import parse_xml, read_urdf

_NAME = "robot_description"


def check_appearance(description: str, drawn: str) -> None:
    """Refuse a URDF for viewers that changes more of the simulated robot's description than its appearance."""
    own, other = _read_physics(description), _read_physics(drawn)
    if differing := sorted(name for name in own.keys() | other.keys() if own.get(name) != other.get(name)):
        raise ConflictError(
            f"robot_description: may differ only in what is seen, but {differing[0]} is another one",
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


def _read_physics(text: str) -> dict[str, BodyLink | BodyJoint]:
    """Read links and joints, by kind and name."""
    urdf = read_urdf(parse_xml(text, _NAME), _NAME)
    links = {f'link name="{name}"': link for name, link in urdf.links.items()}
    return links | {f'joint name="{name}"': joint for name, joint in urdf.joints.items()}
