"""What a robot looks like: of its description, that may be changed while it is simulated, and nothing else."""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree
from functools import lru_cache
from pathlib import Path

from throwcollect.errors import ConfigError, ConflictError

_SEEN = ("visual", "material")
"""Elements that say what is seen. Tooltips of links, which viewers bind plots to, are no part of the physics either."""


def check_appearance(description: str, wanted: str) -> None:
    """Refuse a description by which a robot would be another one, and not only look otherwise.

    Args:
        description: URDF text of the robot that is simulated.
        wanted: URDF text that viewers are to draw.

    Raises:
        ConfigError: If that is no URDF.
        ConflictError: If anything but shapes and colours to be seen differs: joints, masses, collision shapes.
    """
    root = _parse(wanted, "robot_description")
    differing = _physics_of_own(description) ^ _physics_of(root)
    if differing:
        first = min(text.split(">", 1)[0].removeprefix("<") for text in differing)
        raise ConflictError(
            f"robot_description: should differ in what is seen alone, but {first} is another one",
            hint="other joints, masses or collision shapes are another configuration",
        )


def read_urdf(path: Path) -> str:
    """URDF text of a file.

    Raises:
        ConfigError: If it cannot be read, or is no URDF.
    """
    try:
        text = path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise ConfigError(f"{path}: cannot be read: {error}") from error
    _parse(text, str(path))
    return text


def _parse(text: str, name: str) -> ElementTree.Element:
    try:
        root = ElementTree.fromstring(text)  # noqa: S314 - expat expands nothing external, and little else
    except ElementTree.ParseError as error:
        raise ConfigError(f"{name}: should be a URDF: {error}") from error
    if root.tag != "robot":
        raise ConfigError(f"{name}: should be a URDF, with robot as its root, got {root.tag}")
    return root


@lru_cache(maxsize=4)
def _physics_of_own(description: str) -> frozenset[str]:
    return _physics_of(ElementTree.fromstring(description))  # noqa: S314 - it is ours


def _physics_of(robot: ElementTree.Element) -> frozenset[str]:
    """Links and joints without what is seen, each as text that does not depend on how it was written."""
    texts = []
    for element in robot:
        if element.tag not in ("link", "joint"):
            continue
        for seen in [each for each in element if each.tag in _SEEN]:
            element.remove(seen)
        texts.append(ElementTree.canonicalize(ElementTree.tostring(element, encoding="unicode"), strip_text=True))
    return frozenset(texts)
