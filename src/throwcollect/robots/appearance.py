"""Compares robot descriptions, because only the appearance of a robot may change while it is simulated."""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree
from functools import lru_cache
from pathlib import Path

from throwcollect.errors import ConfigError, ConflictError

_SEEN = ("visual", "material")
"""Elements of links that can only be seen, and that the physics ignores."""


def check_appearance(description: str, drawn: str) -> None:
    """Refuse a URDF for viewers that changes more of the simulated robot's description than its appearance.

    Raises:
        ConfigError: If the text for viewers is no URDF.
        ConflictError: If it has other joints, masses or collision shapes.
    """
    if differing := _read_physics(description) ^ _read_physics(drawn):
        first = min(text.split(">", 1)[0].removeprefix("<") for text in differing)
        raise ConflictError(
            f"robot_description: may differ only in what is seen, but {first} is another one",
            hint="other joints, masses or collision shapes are another configuration",
        )


def read_urdf(path: Path) -> str:
    """Read the URDF text of a file.

    Raises:
        ConfigError: If it cannot be read, or is no URDF.
    """
    try:
        text = path.read_text(encoding="utf-8")
    except OSError as error:
        raise ConfigError(f"{path}: cannot be read: {error.strerror}") from error
    except UnicodeDecodeError as error:
        raise ConfigError(f"{path}: should be a URDF, in UTF-8") from error
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
def _read_physics(description: str) -> frozenset[str]:
    """Read links and joints without their appearance, each in the canonical form of XML.

    All other elements are left out, because they are no part of the physics, such as the tooltips of links to which
    viewers bind plots.

    Raises:
        ConfigError: If the text is no URDF, or its elements are nested too deeply to be compared.
    """
    texts = []
    for element in _parse(description, "robot_description"):
        if element.tag not in ("link", "joint"):
            continue
        for visible in [child for child in element if child.tag in _SEEN]:
            element.remove(visible)
        try:
            texts.append(ElementTree.canonicalize(ElementTree.tostring(element, encoding="unicode"), strip_text=True))
        except RecursionError as error:
            raise ConfigError(f"robot_description: a {element.tag} should not be nested so deeply") from error
    return frozenset(texts)
