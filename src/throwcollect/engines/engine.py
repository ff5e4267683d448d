"""The kind of part `Engine`: one world that is loaded from a scene, put into a state, and stepped by joint commands.

An engine knows neither configurations nor trials: it gets values and gives numbers. `throwcollect.sim` has the rules of
a trial, such as when it ends; they are the same on every engine.

Frames and units: world with x forward, y left, z up; metres, radians, seconds, kilograms; quaternions are xyzw.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import cast

import numpy as np
from numpy.typing import NDArray

from throwcollect.engines.body import HERE, BodyLink, BodyModel, LinkInertia, Placement, Vector, turn_of

Quaternion = tuple[float, float, float, float]

Sample = tuple[float, ...]
"""The world at one instant: positions [rad], velocities [rad/s] and motor torques [Nm] of all moving joints, then
position, orientation, linear and angular velocity of each body of the scene that moves, and of the object. These are
bare numbers, as an engine makes a sample every few steps and objects would slow it down."""

UPRIGHT: Quaternion = (0.0, 0.0, 0.0, 1.0)

BODY_NUMBERS = 13
"""How many numbers of a sample belong to a body; the last ones belong to the object."""

GROUND = "ground"
"""Name of the ground in contacts of the object."""


@dataclass(frozen=True)
class BodyState:
    """A body at one instant.

    Attributes:
        position: Its origin in world [m]; that of a box, cylinder or sphere is its centre.
        orientation_xyzw: Unit quaternion, body to world.
        linear_velocity: Of the origin, in world [m/s].
        angular_velocity: In world [rad/s].
    """

    position: Vector
    orientation_xyzw: Quaternion = UPRIGHT
    linear_velocity: Vector = (0.0, 0.0, 0.0)
    angular_velocity: Vector = (0.0, 0.0, 0.0)


@dataclass(frozen=True)
class ToolLink:
    """The tool with which the robot acts on the object.

    Attributes:
        link: Its link in the robot's description.
        name: Its name in contacts of the object.
        opening: Unit vector in the frame of the link; in this direction the tool is open and cannot hold the object.
        seat: Centre in that frame of the object that the tool holds until it lets go of it [m]; None if it holds none.
    """

    link: str
    name: str
    opening: Vector
    seat: Vector | None = None


@dataclass(frozen=True)
class SceneBody:
    """A body of the world; one that moves collides with everything.

    Attributes:
        link: Its name, by which contacts are recorded, its shapes, and its inertia; without an inertia it never moves.
        placement: Its pose in world, at the start.
        friction: Coulomb friction [-], which is multiplied with that of what it touches.
        restitution: Coefficient of restitution [-], which is multiplied likewise.
        rolling_friction_m: Lever arm with which a surface resists its rolling [m], over the friction of that surface.
        velocity: Its velocity in world at the start [m/s].
    """

    link: BodyLink
    placement: Placement = HERE
    friction: float = 1.0
    restitution: float = 1.0
    rolling_friction_m: float = 0.0
    velocity: Vector = (0.0, 0.0, 0.0)

    @property
    def moves(self) -> bool:
        """Whether it moves when it is pushed."""
        return self.link.inertia is not None

    @property
    def start(self) -> Sample:
        """The numbers of a sample for its pose at the start, at rest."""
        return (*self.placement.xyz, *turn_of(self.placement), *(0.0,) * 6)

    @property
    def radius_m(self) -> float:
        """Radius of the sphere around a body of one shape [m]."""
        (shape,) = self.link.shapes
        return shape.radius_m

    @property
    def inertia(self) -> LinkInertia:
        """The inertia of a body that moves."""
        return cast("LinkInertia", self.link.inertia)


@dataclass(frozen=True)
class Scene:
    """The parts of a world; another scene needs another world.

    Attributes:
        robot: The robot with its tool; all joints that move are in `moving`.
        moving: The joints that are commanded, in the order of every command and sample.
        base_height_m: Height of its fixed base above the ground.
        tool: The tool.
        ground_is_solid: Whether the ground stops the object in all steps.
        object: The body that the robot acts on, such as a ball; it has one shape.
        bodies: What else stands in the world.
    """

    robot: BodyModel
    moving: tuple[str, ...]
    base_height_m: float
    tool: ToolLink
    ground_is_solid: bool
    object: SceneBody
    bodies: tuple[SceneBody, ...] = ()

    @property
    def moving_bodies(self) -> tuple[SceneBody, ...]:
        """The bodies that samples hold before the object, in their order there."""
        return tuple(body for body in self.bodies if body.moves)

    def has_robot_of(self, other: Scene) -> bool:
        """Whether nothing but the object and the bodies differs from another scene."""
        return replace(other, object=self.object, bodies=self.bodies) == self


@dataclass(frozen=True)
class Physics:
    """Numbers that the physics of a scene depends on; an engine may ignore those that it has no use for.

    Attributes:
        hz: Physics steps per simulated second.
        solver_iterations: Iterations of the contact solver per step.
        gravity_mps2: Gravity, downwards.
        surface_friction: Coulomb friction of robot, tool and ground [-].
        efforts: Largest torque of each moving joint [Nm].
        position_gain_per_s: Velocity that a motor adds per radian of position error.
        velocity_gain: Share of the velocity error that a motor removes in one step [-].
    """

    hz: int
    solver_iterations: int
    gravity_mps2: float
    surface_friction: float
    efforts: tuple[float, ...]
    position_gain_per_s: float
    velocity_gain: float


@dataclass(frozen=True)
class State:
    """A state that a world can be put into.

    Attributes:
        sample: Robot, bodies and object; the torques do not matter.
        touching: Names of the bodies that press on the object.
    """

    sample: Sample
    touching: frozenset[str]


@dataclass(frozen=True)
class Steps:
    """Physics steps to take, with their commands.

    Attributes:
        targets: Commanded positions of the moving joints [rad], shape ``(n_steps + 1, n_moving)``: one row for the
            beginning of each step, and one for the end of the last.
        velocities: Velocities that lead from each row to the next [rad/s], shape ``(n_steps, n_moving)``.
        first_sample: Number of the first step after which a sample is due; the first step is number 1.
        stride: Steps from one sample to the next.
        drag_kgpm: Force of the air on the object over the square of its speed.
        ground_is_solid: Whether the ground stops the object in these steps, even if that of the scene does not.
        held: Number of the last step in which a tool that holds the object still does; 0 if it lets go at once.
        plane_m: Height at which the observer will likely stop the steps when the object's centre falls through it; an
            engine that computes further steps need not do so from there.
    """

    targets: NDArray[np.float64]
    velocities: NDArray[np.float64]
    first_sample: int
    stride: int
    drag_kgpm: float = 0.0
    ground_is_solid: bool = False
    held: int = 0
    plane_m: float = -math.inf


class Observer:
    """Is called while an engine takes steps, and may stop it; this one ignores all calls."""

    def on_touch(self, step: int, bodies: frozenset[str]) -> None:
        """Take note that other bodies than before press on the object.

        Args:
            step: Number of the first step in which they do.
            bodies: Their names: the tool, `GROUND`, a link of the robot, or a body of the scene.
        """

    def on_sample(self, step: int, sample: Sample) -> bool:
        """Take a sample after a step; the engine has called `on_touch` for that step before.

        Returns:
            True if this step is the last one that the engine takes.
        """
        del step, sample
        return False

    def on_samples(self, steps: range, samples: NDArray[np.float64]) -> int | None:
        """Take the samples after several steps, shape ``(n_samples, n_numbers)``, as `on_sample` takes one.

        Returns:
            Index of the sample after which the engine takes no further step; None if it goes on.
        """
        over = (self.on_sample(step, tuple(sample)) for step, sample in zip(steps, samples.tolist(), strict=True))
        return next((number for number, is_over in enumerate(over) if is_over), None)


@dataclass(frozen=True)
class LoadedRobot:
    """A robot as an engine has it.

    Attributes:
        shapes: Number of collision shapes of each link, by its name.
        mass_matrix: Mass matrix of the moving joints, in their order [kg m², kg m or kg], shape ``(n, n)``.
        tool_m: Origin of the tool's link in world [m].
    """

    shapes: Mapping[str, int]
    mass_matrix: NDArray[np.float64]
    tool_m: Vector


class Engine(ABC):
    """One world with a robot, an object and the ground.

    What follows from a state and commands does not depend, in any bit, on what happened in the world before.
    """

    @classmethod
    def describe_steps(cls) -> str:
        """Say how steps are taken here, if there are several ways, such as ``compiled``; all give the same bits."""
        return ""

    def close(self) -> None:  # noqa: B027 - not every engine has something to free
        """Free the world; it cannot be used afterwards."""

    @abstractmethod
    def load(self, scene: Scene) -> None:
        """Make the world of a scene; the engine may keep parts that are the same as before.

        Raises:
            ConfigError: If the engine does not take the robot's description, or bodies.
        """

    def describe_robot(self, positions: Sequence[float]) -> LoadedRobot | None:  # noqa: ARG002 - for other engines
        """Describe the robot as the engine has it, right after `load`.

        Args:
            positions: Those of the moving joints, at which mass matrix and tool are wanted.

        Returns:
            The robot; None if the engine computes with the values of the scene themselves.
        """
        return None

    @abstractmethod
    def configure(self, physics: Physics) -> None:
        """Set all numbers of the physics, so that no earlier one remains."""

    @abstractmethod
    def rest(self, joints: Sequence[float], seat: Vector | None) -> None:
        """Put joints [rad], and object and bodies at their start, all at rest.

        Args:
            joints: Positions of the moving joints.
            seat: Centre of the object in the frame of the tool [m]; None if it starts at its placement.
        """

    @abstractmethod
    def reset(self, state: State) -> None:
        """Put robot, bodies and object into a state, and leave no trace of earlier ones in the world."""

    @property
    @abstractmethod
    def state(self) -> State:
        """Robot, bodies and object now."""

    @abstractmethod
    def run(self, steps: Steps, observer: Observer) -> int:
        """Take steps until the observer stops them.

        An object that a tool holds (`ToolLink.seat`) moves with it, which counts as touching it, and is free from the
        first step after `Steps.held` on, or once it has been placed elsewhere; then the tool never holds it again.

        Every engine moves an object that nothing touches by the same arithmetic, which `dataset verify` repeats:
        in each step of dt, v += (g - drag_kgpm / mass_kg · |v| · v) · dt, and then x += v · dt.

        An engine may compute further steps, but its world ends in the state of the step at which the observer stopped.

        Returns:
            Number of steps taken.
        """

    @abstractmethod
    def place(self, number: int, state: BodyState) -> None:
        """Set pose and velocity of a body: of the object, number 0, which no tool holds then, or of another one.

        Other bodies that move count from 1, in the order of samples.
        """


def make_rest(scene: Scene, joints: Sequence[float], seat: tuple[Vector, Quaternion] | None) -> State:
    """Make the state in which all is at rest at its start; see `Engine.rest`.

    Args:
        scene: The scene.
        joints: Positions of the moving joints.
        seat: Centre of an object in the tool, in world [m], and orientation of the tool; None if it starts elsewhere.
    """
    placed, touching, still = scene.object.start, frozenset[str](), (0.0,) * len(joints)
    if seat is not None:
        centre, turn = seat
        if scene.tool.seat is None:
            turn = UPRIGHT
        else:
            touching = frozenset({scene.tool.name})
        placed = (*centre, *turn, *placed[7:])
    bodies = [part for body in scene.moving_bodies for part in body.start]
    return State((*joints, *still, *still, *bodies, *placed), touching)


def object_in(sample: Sample) -> BodyState:
    """Read the object from a sample."""
    return body_of(sample[-BODY_NUMBERS:])


def body_of(numbers: Sample) -> BodyState:
    """Read a body from its numbers in a sample."""
    x, y, z, qx, qy, qz, qw, vx, vy, vz, wx, wy, wz = numbers
    return BodyState((x, y, z), (qx, qy, qz, qw), (vx, vy, vz), (wx, wy, wz))


def to_numbers(body: BodyState) -> Sample:
    """Write a body as its numbers in a sample."""
    return (*body.position, *body.orientation_xyzw, *body.linear_velocity, *body.angular_velocity)


def split_bodies(sample: Sample, joints: int) -> list[Sample]:
    """Split off the numbers of each body of the scene that moves, in a sample with some number of moving joints."""
    return [sample[at : at + BODY_NUMBERS] for at in range(3 * joints, len(sample) - BODY_NUMBERS, BODY_NUMBERS)]
