"""A policy in the loop: it is asked at its rate, and its commands become set points of the joints."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Mapping
from functools import reduce
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from throwcollect.config.motion import SESSION
from throwcollect.config.schema import Config
from throwcollect.config.sensors import PictureConfig
from throwcollect.config.values import column_of
from throwcollect.engines.engine import BODY_NUMBERS
from throwcollect.engines.pose import Pose
from throwcollect.errors import ConfigError, Problem
from throwcollect.members import explain_failure, load_member, load_part, names_of
from throwcollect.robots.description import joint_offsets, robot_of, start_posture
from throwcollect.robots.robot import joint_limits
from throwcollect.robots.surroundings import moving_bodies_of
from throwcollect.sensing.scene import Scene
from throwcollect.sensing.sensor import CameraSensor, make_sensor
from throwcollect.sim.world import World
from throwcollect.wording import join_names, suggest

Array = NDArray[np.float64]
Observation = Mapping[str, NDArray[Any]]
"""Arrays by name, with the names, units and frames of an export (`publish.export`): of all joints in the order of
`Robot.joints`, of each body that moves in world, the keys that belong to a target, the target, the last command, and
the pictures of cameras that `task.policy.observation` names."""

_JOINTS = ("joint_position_rad", "joint_velocity_radps", "joint_effort_nm")
_PICTURES = {"color": ("image", 3), "depth": ("depth", 1)}
_BODY = {"position_m": 3, "orientation_xyzw": 4, "velocity_mps": 3, "angular_velocity_radps": 3}


class Policy(Protocol):
    """What commands the joints; any object with these two methods is one."""

    def reset(self, seed: int, target: Mapping[str, float]) -> None:
        """Begin a trial.

        Args:
            seed: Seed of all that is random in the trial.
            target: Where the trial should end, by column; empty if it has no target.
        """

    def act(self, observation: Observation) -> Any:
        """Return the command for the joints of `task.end`, in the order of `Robot.joints`, shape ``(n_moving,)``.

        It is the position at the time of the next observation [rad], or with `task.policy.command: velocity` the
        velocity until then [rad/s]; metres for joints that slide.
        """


def make_policy(config: Config) -> Policy:
    """Make the policy that a configuration names; its function gets the configuration.

    Raises:
        ConfigError: As `find_policy`.
        MemberError: If it cannot be made.
    """
    make, use = find_policy(config), config.task.policy.use if config.task.policy else ""
    with explain_failure("policies", use, "be made"):
        policy: Policy = make(config)
    return policy


def find_policy(config: Config) -> Callable[[Config], Policy]:
    """Import the function that makes the policy of a configuration, and check the names of what it observes.

    Raises:
        ConfigError: If there is no such policy or observation, or the policy cannot be imported.
    """
    check_observation(config)
    use = config.task.policy.use if config.task.policy else ""
    if use == SESSION:
        sentence = "is what clients of a session commanded, so nothing can be simulated again"
        raise ConfigError([Problem(sentence, "task.policy.use")])
    if ":" not in use and use not in (names := names_of("policies")):
        expected = join_names(["module:function", *names], "or")
        raise ConfigError(
            [Problem(f"there is no policy {use!r}{suggest(use, names)}; should be {expected}", "task.policy.use")]
        )
    found: Callable[[Config], Policy]
    found = load_part("policies", use, use) if ":" in use else load_member("policies", use)
    return found


def check_observation(config: Config) -> None:
    """Check the names of what the policy of a configuration observes."""
    known = [*shape_observation(config), *shape_pictures(config)]
    for name in config.task.policy.observation if config.task.policy else ():
        if name not in known:
            sentence = f"there is no {name}{suggest(name, known)}; there are {', '.join(known)}"
            raise ConfigError([Problem(sentence, "task.policy.observation")])


def shape_observation(config: Config) -> dict[str, int]:
    """Count the numbers of each array that a policy may observe, by name; targets count if the trial has them."""
    joints, moving = len(robot_of(config).joints), len(config.task.end)
    shapes = {"time_s": 1, **dict.fromkeys(_JOINTS, joints), "command_position_rad": moving}
    shapes |= {f"{body}_{part}": count for body in moving_bodies_of(config) for part, count in _BODY.items()}
    targets = (each.name for each in config.task.target_columns)
    return shapes | dict.fromkeys((*map(column_of, config.task.given), *targets), 1)


def shape_pictures(config: Config) -> dict[str, tuple[int, int, int]]:
    """List the shapes of the pictures that a policy may observe, by name: height, width, and number of channels."""
    shapes = {}
    for name, section in config.sensors.items():
        if isinstance(section, PictureConfig):
            for stream, (part, channels) in _PICTURES.items():
                if stream in section.recorded:
                    shapes[f"{name}_{part}"] = section.height, section.width, channels
    return shapes


class PolicyLoop:
    """Asks a policy once in each period, and turns its commands into set points of the moving joints.

    Set points lie on a cubic from the last command to the present one, which is reached when the policy is asked again.
    Its velocity goes on from command to command, so that motors are not jerked. Commands are clipped to the range of
    the joint, and to what it can reach at its velocity limit.

    Attributes:
        stride: Physics steps from one command to the next.
        joints: Joints that are commanded.
        sent: The last command, as it was sent [rad].
        clipped: Whether it is not what the policy asked for.
        object: The object as it was last observed, as numbers of a sample, shape ``(13,)``.
    """

    def __init__(self, config: Config, policy: Policy, world: World) -> None:
        section, robot = config.task.policy, robot_of(config)
        assert section is not None  # noqa: S101 - only such configurations have a loop
        self.policy, self._section, self._world = policy, section, world
        self.stride = config.sim.physics_hz // section.rate_hz
        self.joints = config.moving_joints
        self._names = tuple(section.observation or shape_observation(config))
        limits, own = joint_limits(robot), [robot.joints.index(joint) for joint in self.joints]
        self.lower, self.upper, self.speed = limits.lower[own], limits.upper[own], limits.velocity[own]
        self._reach = self.speed * (self.stride / config.sim.physics_hz)
        self._shares = np.arange(1, self.stride + 1)[:, np.newaxis] / self.stride
        self._columns = [world.moving.index(joint) for joint in self.joints]
        self._shown = [robot.joints.index(joint) for joint in world.moving]
        self._bodies = moving_bodies_of(config)
        self._robot = robot
        parts = [part for part, _ in _PICTURES.values()]
        self._seen_by = [name for name in config.sensors if any(f"{name}_{part}" in self._names for part in parts)]

    def begin(self, config: Config, number: int, seed: int, target: Mapping[str, float]) -> None:
        """Begin a trial, in the start state of its configuration."""
        given = {column_of(key): reduce(getattr, key.split("."), config) for key in config.task.given}
        self._number, self._given = number, {name: np.array([value]) for name, value in {**given, **target}.items()}
        posture = start_posture(config)
        self._still = np.array([posture[joint] for joint in self._robot.joints])
        self.sent = np.array([posture[joint] for joint in self.joints])
        self._offsets = joint_offsets(config)[self._shown]
        self._moved = self._speed = np.zeros(len(self.joints))
        self._log: list[tuple[Array, Array]] = []
        self._observed: tuple[int, Observation] = (-1, {})
        self._cameras: dict[str, CameraSensor] = {}
        if self._seen_by:
            self._scene = Scene.of(config)
            made = {name: make_sensor(name, config, self._scene, number) for name in self._seen_by}
            self._cameras = {name: sensor for name, sensor in made.items() if isinstance(sensor, CameraSensor)}
        if missing := [name for name in self._section.observation if name not in self.observe()]:
            sentence = f"trial {number} has no {missing[0]}: its plan has no targets"
            raise ConfigError([Problem(sentence, "task.policy.observation")])
        with explain_failure("policies", self._section.use, f"begin trial {number}"):
            self.policy.reset(seed, dict(target))

    def observe(self) -> Observation:
        """Observe the world now."""
        steps, world = self._world.steps, self._world
        if self._observed[0] == steps:
            return self._observed[1]
        count, sample = len(self._shown), np.array(world.engine.state.sample)
        position, velocity, effort = self._still.copy(), *np.zeros((2, len(self._still)))
        position[self._shown] = sample[:count] - self._offsets
        velocity[self._shown], effort[self._shown] = sample[count : 2 * count], sample[2 * count : 3 * count]
        found: dict[str, NDArray[Any]] = dict(zip(_JOINTS, (position, velocity, effort), strict=True))
        found |= {"time_s": np.array([steps / world.physics_hz]), "command_position_rad": self.sent.copy()}
        # The object comes last in a sample, and first in the names.
        bodies = sample[3 * count :].reshape(-1, BODY_NUMBERS)
        for body, numbers in zip(self._bodies, (bodies[-1], *bodies[:-1]), strict=True):
            first = 0
            for part, size in _BODY.items():
                found[f"{body}_{part}"] = numbers[first : first + size]
                first += size
        found |= {name: value.copy() for name, value in self._given.items()}
        self.object = bodies[-1]
        if self._cameras:
            poses = [Pose.of(numbers[:3], numbers[3:7]) for numbers in (bodies[-1], *bodies[:-1])]
            placed = self._scene.place(position, poses)
            for name, camera in self._cameras.items():
                seen = camera.see_noisily(placed, steps)
                found[f"{name}_depth"] = seen.depth[:, :, np.newaxis].astype(np.float32)
                if seen.color is not None:
                    found[f"{name}_image"] = seen.color
        self._observed = steps, {name: found[name] for name in self._names if name in found}
        return self._observed[1]

    def ask(self) -> None:
        """Ask the policy for its next command."""
        section, began_s = self._section, time.monotonic()
        at = f"act at {self._world.steps / self._world.physics_hz:.3f} s of trial {self._number}"
        with explain_failure("policies", section.use, at):
            asked = np.array(self.policy.act(self.observe()), np.float64)
            if asked.shape != self.sent.shape or not math.isfinite(asked.sum()):
                what = f"{len(self.joints)} finite numbers, for {', '.join(self.joints)}"
                raise ValueError(f"a command should be {what}; got {asked.tolist()}")
            if (took_s := time.monotonic() - began_s) > section.timeout_s:
                raise TimeoutError(f"it took {took_s:.2f} s; task.policy.timeout_s is {section.timeout_s:g}")
        before, reach = self.sent, self._reach
        if section.command == "velocity":
            asked = before + asked * (self.stride / self._world.physics_hz)
        near = np.minimum(np.maximum(asked, before - reach), before + reach)
        self.sent = np.minimum(np.maximum(near, self.lower), self.upper)
        self.clipped = bool((asked != self.sent).any())
        self._log.append((asked, self.sent))
        # In units of the period, the velocity at the end of a parabola through this command and the two before it.
        moved = self.sent - before
        start, end = self._speed, np.minimum(np.maximum(1.5 * moved - 0.5 * self._moved, -reach), reach)
        quadratic, cubic, shares = 3 * moved - 2 * start - end, start + end - 2 * moved, self._shares
        self._points = before + shares * (start + shares * (quadratic + shares * cubic))
        self._points[-1] = self.sent
        self._moved, self._speed = moved, end

    def fill(self, commands: Array) -> None:
        """Write the set points of the next steps, shape ``(n_steps, n_moving)``, within one period."""
        first = self._world.steps % self.stride
        commands[:, self._columns] = self._points[first : first + len(commands)]

    def commands(self, steps: NDArray[np.int64]) -> Array:
        """Return what the policy asked for and what was sent, at some physics steps, shape ``(n_steps, 2, n)``."""
        asked = np.minimum(steps // self.stride, len(self._log) - 1)
        return np.array(self._log)[asked]
