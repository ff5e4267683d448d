"""Links and joints of a description as a tree."""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree
from collections.abc import Sequence
from dataclasses import dataclass

from throwcollect.errors import RequestError


@dataclass(frozen=True)
class Joint:
    """One joint.

    Attributes:
        name: Its name.
        kind: Its type in URDF.
        parent: Link that it is attached to.
        child: Link that it carries.
        element: The joint as it is written for the physics engine.
    """

    name: str
    kind: str
    parent: str
    child: str
    element: ElementTree.Element


def check_tree(links: Sequence[str], joints: Sequence[Joint]) -> str:
    """Check that joints connect all links to one tree.

    Args:
        links: Names of the links.
        joints: The joints.

    Returns:
        The root.

    Raises:
        RequestError: ``RESOURCE_PARSE_ERROR`` if they do not.
    """
    carried: dict[str, str] = {}
    names = set()
    for joint in joints:
        for link in (joint.parent, joint.child):
            if link not in links:
                raise RequestError("RESOURCE_PARSE_ERROR", f"joint {joint.name}: there is no link {link:.80}")
        if joint.name in names:
            raise RequestError("RESOURCE_PARSE_ERROR", f"joint {joint.name} is there twice")
        if joint.child in carried:
            message = f"link {joint.child} hangs on two joints: {carried[joint.child]} and {joint.name}"
            raise RequestError("RESOURCE_PARSE_ERROR", message)
        names.add(joint.name)
        carried[joint.child] = joint.name
    # Every link hangs on one joint at most by now, so more than one root means parts, and none means a ring.
    roots = [link for link in links if link not in carried]
    if len(roots) > 1:
        raise RequestError("RESOURCE_PARSE_ERROR", f"links {roots[0]} and {roots[1]} are not connected")
    if not roots or len(_reach(roots[0], joints)) < len(links):
        raise RequestError("RESOURCE_PARSE_ERROR", "the joints form a ring")
    return roots[0]


def rigid_root(root: str, joints: Sequence[Joint]) -> set[str]:
    """The links that are rigidly connected to the root, and the root itself."""
    return _reach(root, [joint for joint in joints if joint.kind == "fixed"])


def _reach(root: str, joints: Sequence[Joint]) -> set[str]:
    children: dict[str, list[str]] = {}
    for joint in joints:
        children.setdefault(joint.parent, []).append(joint.child)
    reached, waiting = set(), [root]
    while waiting:
        link = waiting.pop()
        reached.add(link)
        waiting.extend(children.get(link, ()))
    return reached
