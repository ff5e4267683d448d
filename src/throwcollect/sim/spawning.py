"""Putting new entities into the world: names, namespaces, places, descriptions."""

from __future__ import annotations

import re
from dataclasses import dataclass
from itertools import count

from throwcollect.engines.engine import BodyState
from throwcollect.errors import RequestError
from throwcollect.robots.robot import Robot
from throwcollect.sim.entities import WORLD_FRAME, Entities
from throwcollect.sim.resources import load_model

_LONGEST_NAME = 100
_NAME = re.compile(rf"[A-Za-z0-9_][A-Za-z0-9_.-]{{0,{_LONGEST_NAME - 1}}}")
_NAMESPACE = re.compile(r"/?[A-Za-z_][A-Za-z0-9_]*(/[A-Za-z_][A-Za-z0-9_]*)*|/?")
_LONGEST_NAMESPACE = 245
"""As rmw limits it."""


@dataclass(frozen=True)
class SpawnRequest:
    """A wish for a new entity.

    Attributes:
        name: Its name; empty for that of its description.
        allow_renaming: Whether another name will do.
        uri: Where its description is.
        text: Its description, if there is no URI.
        namespace: Namespace that its interfaces would have.
        start: Its pose in the frame.
        frame: The world, or an entity; empty for the world.
    """

    name: str
    allow_renaming: bool
    uri: str
    text: str
    namespace: str
    start: BodyState
    frame: str


def spawn(entities: Entities, request: SpawnRequest, robot: Robot) -> str:
    """Put a new entity into the world; a wish that cannot be met changes nothing.

    Args:
        entities: Where to put it.
        request: The wish.
        robot: The robot, beside whose description those of ``package://`` are.

    Returns:
        Its name.

    Raises:
        RequestError: ``NAME_INVALID``, ``NAME_NOT_UNIQUE``, ``NAMESPACE_INVALID``, ``INVALID_POSE``, the reasons of
            `load_model`, and those of `Entities.add`.
    """
    if request.name or not request.allow_renaming:
        _check_name(entities, request)
    if len(request.namespace) > _LONGEST_NAMESPACE or not _NAMESPACE.fullmatch(request.namespace):
        message = f"namespace {request.namespace!r:.80}"
        raise RequestError("NAMESPACE_INVALID", message, expected="such as /left/table, or nothing")
    start = entities.in_world(request.start, request.frame)
    model = load_model(request.uri, request.text, robot)
    name = _free_name(entities, request.name or model.name)
    origin = f"URDF {model.name!r:.80}" + (f" of {request.uri:.500}" if request.uri else "")
    namespace = f", namespace {request.namespace}" if request.namespace else ""
    entities.add(name, model, start, origin + namespace)
    return name


def _check_name(entities: Entities, request: SpawnRequest) -> None:
    if not _NAME.fullmatch(request.name) or request.name == WORLD_FRAME:
        raise RequestError(
            "NAME_INVALID",
            f"name {request.name!r:.120}",
            expected=f"1 to {_LONGEST_NAME} letters, digits and _ . -, beginning with neither . nor -, other than "
            f"{WORLD_FRAME}",
            hint=None if request.name else "allow_renaming, and the name of the description is taken",
        )
    if request.name in entities.names and not request.allow_renaming:
        raise RequestError("NAME_NOT_UNIQUE", f"there is an entity {request.name!r}", hint="allow_renaming")


def _free_name(entities: Entities, wish: str) -> str:
    """A name that nobody has: the one that is wished for, or that with a number."""
    stem = re.sub(r"[^A-Za-z0-9_]", "_", wish[:_LONGEST_NAME]) if not _NAME.fullmatch(wish) else wish
    stem = stem or "entity"
    taken = {WORLD_FRAME, *entities.names}
    if stem not in taken:
        return stem
    return next(name for number in count(1) if (name := f"{stem[: _LONGEST_NAME - 4]}_{number}") not in taken)
