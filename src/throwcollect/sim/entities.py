"""The entities of a world, by name: ball, robot, and the bodies that clients have spawned."""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import IntEnum

import numpy as np

from throwcollect.engines.body import BodyModel, Vector
from throwcollect.engines.engine import BodyState, Box
from throwcollect.errors import RequestError
from throwcollect.pinocchio_library import pinocchio
from throwcollect.sim.world import World

BALL = "ball"
WORLD_FRAME = "world"
_LARGEST_COORDINATE_M = 1e3
_LARGEST_SPEED = 1e3
"""Largest speed that a client may give a body [m/s, rad/s]: a faster body would soon be too far away to be a number."""

_NORM_TOLERANCE = 1e-3
_MOST_SPAWNED = 200
_LONGEST_INFO = 65_536


class Category(IntEnum):
    """Constants of simulation_interfaces/msg/EntityCategory."""

    OBJECT = 0
    ROBOT = 1
    HUMAN = 2
    DYNAMIC_OBJECT = 4
    STATIC_OBJECT = 5


@dataclass(frozen=True)
class EntityInfo:
    """Description of an entity for people, and category and tags for filters."""

    category: int
    description: str = ""
    tags: tuple[str, ...] = ()


class Entities:
    """The entities of one world; the robot is an entity by its own name."""

    def __init__(self, world: World, robot: str) -> None:
        self._world = world
        self._robot = robot
        self._first_infos = {
            BALL: EntityInfo(Category.DYNAMIC_OBJECT, "what is thrown"),
            robot: EntityInfo(Category.ROBOT, "the robot that throws; its base is fixed"),
        }
        self._infos: dict[str, EntityInfo] = {}

    @property
    def names(self) -> tuple[str, ...]:
        """Names of all entities: ball, robot, then what was spawned, in order."""
        return (BALL, self._robot, *self._world.spawned.names)

    def forget_infos(self) -> None:
        """Restore the descriptions of ball and robot, and forget the descriptions of removed entities."""
        for name in [name for name in self._infos if name not in self._world.spawned]:
            del self._infos[name]

    def info(self, name: str) -> EntityInfo:
        """Return the description of an entity."""
        self._require(name)
        return self._infos.get(name) or self._first_infos[name]

    def set_info(self, name: str, info: EntityInfo) -> None:
        """Replace the description of an entity."""
        self._require(name)
        if info.category not in list(Category):
            known = ", ".join(f"{category} {category.name}" for category in Category)
            raise RequestError("RESULT_OPERATION_FAILED", f"no category {info.category}", expected=known)
        length = len(info.description) + sum(len(tag) + 1 for tag in info.tags)
        if length > _LONGEST_INFO:
            message = f"description and tags have {length} characters; at most {_LONGEST_INFO}"
            raise RequestError("RESULT_OPERATION_FAILED", message)
        self._infos[name] = info

    def state(self, name: str) -> BodyState:
        """Tell where an entity is and how it moves, in the world."""
        self._require(name)
        if name == BALL:
            return self._world.ball
        if name == self._robot:
            return self._world.robot_base
        return self._world.spawned.engine_bodies(name).state(name)

    def place(self, name: str, state: BodyState, *, frame: str, accelerates: bool) -> None:
        """Put an entity into a state that is given in some frame, as `in_world` takes it.

        `accelerates` tells whether the client asked for an acceleration as well.
        """
        self._require(name)
        if name == self._robot:
            raise RequestError("RESULT_OPERATION_FAILED", f"{name} is fixed to the world")
        state = self.in_world(state, frame)
        speeds = (*state.linear_velocity, *state.angular_velocity)
        if not all(abs(speed) <= _LARGEST_SPEED for speed in speeds):
            expected = f"numbers up to {_LARGEST_SPEED:g} m/s and rad/s"
            raise RequestError("RESULT_OPERATION_FAILED", f"{name}: twist {speeds}", expected=expected)
        if name == BALL:
            self._world.ball = state
            return
        if self._world.spawned.model(name).is_fixed and (any(speeds) or accelerates):
            raise RequestError("RESULT_OPERATION_FAILED", f"{name} is fixed and can have no twist or acceleration")
        self._world.spawned.engine_bodies(name).place(name, state)

    def in_world(self, state: BodyState, frame: str) -> BodyState:
        """Convert a state from some frame to the world; a frame is an entity, or the world, which may be left empty.

        Velocities are along the axes of the frame, as seen from the world.
        """
        norm = math.hypot(*state.orientation_xyzw)
        # The conditions here and below are written as `not ... <=`, so that they refuse NaN, too, for which no
        # comparison holds.
        if not abs(norm - 1.0) <= _NORM_TOLERANCE:
            message = f"orientation {state.orientation_xyzw}: a quaternion of norm {norm:g}"
            raise RequestError("INVALID_POSE", message, expected="norm 1")
        if frame not in ("", WORLD_FRAME):
            if frame not in self.names:
                known = ", ".join((WORLD_FRAME, *self.names))
                raise RequestError("INVALID_POSE", f"no frame {frame!r:.80}", expected=known)
            base = self.state(frame)
            turn = pinocchio.Quaternion(np.array(base.orientation_xyzw))
            state = BodyState(
                tuple((base.position + turn * np.array(state.position)).tolist()),
                tuple((turn * pinocchio.Quaternion(np.array(state.orientation_xyzw))).coeffs().tolist()),
                tuple((turn * np.array(state.linear_velocity)).tolist()),
                tuple((turn * np.array(state.angular_velocity)).tolist()),
            )
        if not all(abs(value) <= _LARGEST_COORDINATE_M for value in state.position):
            expected = f"within {_LARGEST_COORDINATE_M:g} m of the world's origin"
            raise RequestError("INVALID_POSE", f"position {state.position} m", expected=expected)
        return state

    def boxes(self, name: str) -> list[Box]:
        """Find the boxes along the axes of the world that enclose an entity, one for each of its links."""
        self._require(name)
        if name == BALL:
            return self._world.engine.ball_boxes()
        if name == self._robot:
            return self._world.engine.robot_boxes()
        return self._world.spawned.engine_bodies(name).boxes(name)

    def bounds(self, name: str) -> Box | None:
        """Find the box along the axes of an entity's own frame that encloses it; None if it has no shape."""
        if name in self._world.spawned:
            return _unite(self._world.spawned.engine_bodies(name).bounds(name))
        # The robot's axes are those of the world, and a ball has the same box along any axes.
        origin = self.state(name).position
        return _unite([tuple(np.subtract(box, origin).tolist()) for box in self.boxes(name)])

    def add(self, name: str, model: BodyModel, start: BodyState, description: str) -> None:
        """Put a new entity into the world, under a name that is free."""
        if len(self._world.spawned) >= _MOST_SPAWNED:
            raise RequestError("RESULT_OPERATION_FAILED", f"{_MOST_SPAWNED} entities were spawned; there is no room")
        self._world.spawned.add(name, model, start)
        kind = Category.ROBOT if model.moving else Category.STATIC_OBJECT if model.is_fixed else Category.DYNAMIC_OBJECT
        self._infos[name] = EntityInfo(kind, description)

    def remove(self, name: str) -> None:
        """Take an entity out of the world."""
        self._require(name)
        if name not in self._world.spawned:
            raise RequestError("RESULT_OPERATION_FAILED", f"{name} is part of every trial and cannot be deleted")
        self._world.spawned.remove(name)
        del self._infos[name]

    def _require(self, name: str) -> None:
        if name not in self.names:
            known = ", ".join(self.names)
            raise RequestError("RESULT_NOT_FOUND", f"no entity {name!r:.80}; known: {known:.1000}")


def _unite(boxes: list[Box]) -> Box | None:
    if not boxes:
        return None
    lows, highs = zip(*boxes, strict=True)
    lowest: Vector = tuple(map(min, zip(*lows, strict=True)))
    highest: Vector = tuple(map(max, zip(*highs, strict=True)))
    return lowest, highest
