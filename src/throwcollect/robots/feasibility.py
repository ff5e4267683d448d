"""Checks joint trajectories: whether limits are kept, the robot is clear of itself, and the tool holds the ball."""

from __future__ import annotations

import math
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import replace
from functools import lru_cache, partial
from itertools import groupby

import numpy as np
from numpy.typing import NDArray

from throwcollect.config.schema import Config
from throwcollect.engines.body import Placement
from throwcollect.engines.engine import SceneBody
from throwcollect.engines.pinocchio_library import pinocchio
from throwcollect.errors import ConfigError
from throwcollect.robots.clearance import MARGIN_M, Clearance, find_overlap
from throwcollect.robots.description import (
    check_names,
    find_locked_joints,
    joint_offsets,
    robot_of,
    start_posture,
)
from throwcollect.robots.dynamics import Dynamics
from throwcollect.robots.joint_model import joint_model, mount_of
from throwcollect.robots.robot import joint_limits, shares_of
from throwcollect.robots.surroundings import bodies_of, object_of, starts_in_tool
from throwcollect.robots.tools.tool import Tool, tool_of
from throwcollect.robots.trajectory import JointTrajectory, sample_quintic

_CHECKED_HZ = 100
_CHECKED_LEAST = 100
_CLEARANCE_STEP_RAD = 0.02
_POSITION_SLACK_RAD = 1e-6
_LOWEST_WAY_OUT_RAD = -0.02
"""A way out that goes down by less than this counts as level, because a ball takes a second or more to leave on it."""
_SURELY = 1 - 1e-6
"""A value below this share of its limit is within the limit however it is computed: ways to do so agree to 1e-8."""
_TRIALS_AT_ONCE = 25
"""Number of trials whose arrays stay in the processor's cache."""
_Trial = tuple[Config, JointTrajectory]

Motion = tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]
"""Positions [rad], velocities [rad/s] and accelerations [rad/s²], each of shape ``(n, n_joints)``, in the order of
`Robot.joints`."""


class Feasibility:
    """Checks joint trajectories against the limits of a robot.

    One object serves all trials of a collection: each check sets posture, masses, gravity and limits of its trial. Only
    a trial with another tool takes longer, because pairs of shapes are built anew.
    """

    def __init__(self, config: Config) -> None:
        self._robot = robot_of(config)
        self._model = joint_model(self._robot)
        self._data = self._model.createData()
        self._columns = np.array([self._model.idx_qs[self._model.getJointId(joint)] for joint in self._robot.joints])
        hand = self._model.frames[self._model.getFrameId(self._robot.hand, pinocchio.BODY)]
        self._hand = hand.parentJoint
        self._hand_placement = hand.placement
        chain = list(self._model.supports[self._hand])[1:]
        self._carrying = [self._robot.joints.index(self._model.names[joint]) for joint in chain]
        self._limits = limits = joint_limits(self._robot)
        # About the middle of its range, a joint has one limit in both directions.
        self._middle, half = (limits.upper + limits.lower) / 2, (limits.upper - limits.lower) / 2
        self._half = half + _POSITION_SLACK_RAD
        self._dynamics = Dynamics(self._robot, self._model, {})
        check_names(config, self._robot, tool_of(config))
        # These take long to make, and nearly all trials have the same.
        self._make_dynamics = lru_cache(maxsize=1)(lambda locked: Dynamics(self._robot, self._model, dict(locked)))
        self._make_clearance = lru_cache(maxsize=3)(partial(Clearance, self._robot, self._model))

    def check(self, config: Config, trajectory: JointTrajectory) -> str | None:
        """Explain why the robot cannot do a trial with a trajectory.

        The curve between the points is checked at 100 Hz and at 100 instants at least; for collisions, whenever a joint
        has moved on by 0.02 rad. Joints that the trajectory does not move rest at the trial's start posture. Torques
        are computed by inverse dynamics plus viscous friction; the tool and the object in it count as part of
        the hand throughout, even after the object has left. The effort of locked joints is not limited, because they
        are simulated as rigid. Angles are true ones (`robot.joint_offsets`), and motions have their true speed
        (`robot.speed_scale`). Collisions are those of the robot and the tool, also with bodies of the scene, and at the
        start with an object that lies elsewhere; the task judges what the object hits. The tool has to move if it acts
        on the object, and to hold what lies in it in the start posture (see `Tool.way_out`).

        Returns:
            None if the trial is feasible. Otherwise one sentence with joint or links, instant, value and limit, about
            the first of these checks that fails: position, velocity, effort, collision, a tool that has to move, a ball
            that has to stay. For limits, it has the worst violation; for collisions, the first one.
        """
        posture = np.array(list(start_posture(config).values())) + joint_offsets(config)
        joints, tool = self._robot.joints, tool_of(config)
        instants = max(_CHECKED_LEAST, math.ceil(trajectory.times[-1] * _CHECKED_HZ)) + 1
        times = np.linspace(0.0, trajectory.times[-1], instants)
        rest, offsets = np.tile(posture, (instants, 1)), joint_offsets(config)
        motion = _sample(self._robot.joints, trajectory, times, rest, offsets, config.robot.speed_scale)
        if violation := self._find_violation(config, times, motion):
            return violation
        positions = motion[0]
        rows = _choose_rows(positions)
        way = self._model_order(positions[rows])
        bodies = bodies_of(config)
        if overlap := self._find_overlap(config, tool, bodies, way[:1]):
            return overlap
        approaches = (clearance.first_approach(way) for clearance in self._list_clearances(config, bodies))
        if approach := next(filter(None, approaches), None):
            return (
                f"{' and '.join(approach.links)} {_describe_gap(approach.distance_m)} "
                f"at {times[rows[approach.index]]:.3f} s; they must stay {MARGIN_M * 1000:.3g} mm apart"
            )
        # A trial whose tool never moves is a mistake in the configuration, and not a short throw.
        moves = config.task.tool_acts and config.task.policy is None
        if moves and np.ptp(positions[:, self._carrying], axis=0).max() <= _POSITION_SLACK_RAD:
            carrying = ", ".join(joints[column] for column in self._carrying)
            return f"task.end moves no joint that carries the {tool.name}; these do: {carrying}"
        return self._explain_loss(config, posture)

    def find_feasible(self, trials: Sequence[_Trial]) -> NDArray[np.bool_]:
        """Find trials of a sweep that `check` surely accepts, in a fraction of its time; shape ``(n_trials,)``.

        Curves, limits and torques of many trials are arrays, and trials share the postures in which links are compared.
        What is too close to a limit to be sure is left to `check`, so nothing depends on how sums are rounded here.
        """
        sure = np.zeros(len(trials), np.bool_)
        for _, group in groupby(enumerate(trials), lambda numbered: _describe_shapes(numbered[1][0])):
            numbers, alike = zip(*group, strict=True)
            if len(alike) == 1:
                # There is nothing to share.
                continue
            with suppress(ConfigError):
                sure[[*numbers]] = self._find_feasible_alike(alike)
        return sure

    def _find_feasible_alike(self, trials: Sequence[_Trial]) -> NDArray[np.bool_]:
        """Find trials that `check` surely accepts among some whose tool and bodies have the same shapes and places."""
        config = trials[0][0]
        tool, bodies = tool_of(config), bodies_of(config)
        dynamics = self._make_dynamics(tuple(find_locked_joints(config).items()))
        free = dynamics.columns
        offsets = np.array([joint_offsets(each) for each, _ in trials])
        postures = np.array([[*start_posture(each).values()] for each, _ in trials]) + offsets
        keys = [(posture.tobytes(), object_of(each)) for posture, (each, _) in zip(postures, trials, strict=True)]
        starts = {key: number for number, key in enumerate(keys)}
        for key, number in starts.items():
            each, posture = trials[number][0], postures[number]
            overlap = self._find_overlap(each, tool, bodies, self._model_order(posture[None]))
            starts[key] = not (overlap or self._explain_loss(each, posture))
        sure = np.array([starts[key] for key in keys])
        # Joints that are locked rest at the same angles in all trials of a sweep.
        sure &= (np.delete(postures == postures[0], free, axis=1)).all(axis=1)
        sure &= (shares_of(postures - self._middle, self._half) <= _SURELY).all(axis=1)
        ways, counts = [], []
        for first in range(0, len(trials), _TRIALS_AT_ONCE):
            some = slice(first, first + _TRIALS_AT_ONCE)
            within, way, count = self._find_within_limits(dynamics, trials[some], postures[some], offsets[some])
            sure[some] &= within
            ways.append(way.T)
            counts.append(count)
        numbers = np.repeat(np.arange(len(trials)), np.concatenate(counts))
        there = sure[numbers]
        way, numbers = np.concatenate(ways, axis=1).compress(there, axis=1), numbers[there]
        for clearance in self._list_clearances(config, bodies):
            sure &= clearance.find_clear(self._model_order(postures[0]), self._columns[free], way, numbers, len(trials))
        return sure

    def _find_within_limits(
        self,
        dynamics: Dynamics,
        trials: Sequence[_Trial],
        postures: NDArray[np.float64],
        offsets: NDArray[np.float64],
    ) -> tuple[NDArray[np.bool_], NDArray[np.float64], NDArray[np.intp]]:
        """Find trials whose free joints surely keep their limits, and move the tool where they have to.

        Returns:
            Whether each does; the free joints at the instants of one trial after the other; numbers of these instants.
        """
        task, free, limits = trials[0][0].task, dynamics.columns, self._limits
        joined, times, counts = _join([trajectory for _, trajectory in trials])
        firsts, numbers = np.cumsum(counts) - counts, np.repeat(np.arange(len(trials)), counts)
        speeds = np.array([[each.robot.speed_scale] for each, _ in trials])[numbers]
        names = [self._robot.joints[column] for column in free]
        motion = _sample(names, joined, times, postures[numbers][:, free], offsets[numbers][:, free], speeds)
        efforts = np.empty_like(motion[0])
        worlds = [(object_of(each), each.scene.gravity_mps2, each.robot.effort_scale) for each, _ in trials]
        for world, group in groupby(range(len(trials)), worlds.__getitem__):
            one, *_ = alike = [*group]
            rows = slice(firsts[one], firsts[alike[-1]] + counts[alike[-1]])
            efforts[rows] = (
                dynamics.compute_efforts(trials[one][0], tool_of(trials[one][0]), [array[rows] for array in motion])
                / world[-1]
            )
        within = np.ones(len(times), np.bool_)
        for values, limit in (
            (motion[0] - self._middle[free], self._half),
            (motion[1], limits.velocity),
            (efforts, limits.effort),
        ):
            within &= (shares_of(values, limit[free]) <= _SURELY).all(axis=1)
        sure: NDArray[np.bool_] = np.logical_and.reduceat(within, firsts)
        if task.tool_acts and task.policy is None:
            moved = np.abs(motion[0][firsts + counts - 1] - motion[0][firsts])[:, np.isin(free, self._carrying)]
            sure &= moved.max(axis=1, initial=0.0) > _POSITION_SLACK_RAD
        return sure, motion[0], counts

    def _find_violation(self, config: Config, times: NDArray[np.float64], motion: Motion) -> str | None:
        """Find the first kind of limit that a motion violates, and the worst violation of it."""
        joints, limits = self._robot.joints, self._limits
        positions, velocities, _ = motion
        if worst := _find_worst(positions - self._middle, self._half):
            row, joint = worst
            unit = self._robot.unit_of(joints[joint])
            side, limit = ("upper", limits.upper) if positions[worst] > self._middle[joint] else ("lower", limits.lower)
            return (
                f"{joints[joint]} is at {positions[worst]:.4g} {unit} at {times[row]:.3f} s; "
                f"its {side} limit is {limit[joint]:.4g} {unit}"
            )
        if worst := _find_worst(velocities, limits.velocity):
            row, joint = worst
            unit = self._robot.unit_of(joints[joint])
            return (
                f"{joints[joint]} moves at {abs(velocities[worst]):.4g} {unit}/s at {times[row]:.3f} s; "
                f"its limit is {limits.velocity[joint]:.4g} {unit}/s"
            )
        locked, columns = find_locked_joints(config), self._dynamics.columns
        limit = np.where([joint in locked for joint in joints], np.inf, limits.effort * config.robot.effort_scale)
        # All joints are computed, so that the numbers do not depend on which joints are locked.
        efforts = np.empty_like(positions)
        tool = tool_of(config)
        efforts[:, columns] = self._dynamics.compute_efforts(config, tool, [array[:, columns] for array in motion])
        if worst := _find_worst(efforts, limit):
            row, joint = worst
            unit = "N" if joints[joint] in self._robot.sliding else "Nm"
            return (
                f"{joints[joint]} needs {abs(efforts[worst]):.4g} {unit} at {times[row]:.3f} s; "
                f"its limit is {limit[joint]:.4g} {unit}"
            )
        return None

    def _explain_loss(self, config: Config, posture: NDArray[np.float64]) -> str | None:
        """Explain why the object does not stay in the tool of the still robot; None if it does, or starts elsewhere."""
        pinocchio.forwardKinematics(self._model, self._data, self._model_order(posture))
        if not starts_in_tool(config):
            return None
        tool, radius = tool_of(config), object_of(config).radius_m
        # The last row of a rotation into world is the vertical of the world, along the axes of the frame.
        up = (self._data.oMi[self._hand] * self._hand_placement * mount_of(self._robot, tool)).rotation[2]
        slope = tool.way_out(radius, up)
        if slope >= _LOWEST_WAY_OUT_RAD:
            return None
        tilt = math.acos(max(-1.0, min(1.0, float(up[0]))))
        safe = tool.way_out(radius, np.array([1.0, 0.0, 0.0]))
        return (
            f"task.start does not hold the ball: it tilts the {tool.name} by {tilt:.3g} rad, so that the ball rolls "
            f"out, {-slope:.3g} rad downwards; up to {safe:.3g} rad, a tilt in any direction is safe"
        )

    def _find_overlap(
        self, config: Config, tool: Tool, bodies: tuple[SceneBody, ...], start: NDArray[np.float64]
    ) -> str | None:
        """Explain what the object or a body that moves overlaps at the start; None if nothing."""
        thing = object_of(config)
        if starts_in_tool(config):
            pinocchio.forwardKinematics(self._model, self._data, start[0])
            hand = self._data.oMi[self._hand] * self._hand_placement * mount_of(self._robot, tool)
            x, y, z = hand.act(np.array(tool.ball_seat(thing.radius_m))).tolist()
            thing = replace(thing, placement=Placement((x, y, z + config.robot.base_height_m)))
        else:
            # Later, the robot may touch the object.
            _, around = self._list_clearances(config, (thing,))
            approach = around.first_approach(start)
            if approach is not None and approach.distance_m < 0:
                return f"{' and '.join(approach.links)} overlap at the start"
        return find_overlap((thing, *bodies))

    def _list_clearances(self, config: Config, bodies: tuple[SceneBody, ...]) -> list[Clearance]:
        """Return what checks the robot against itself, and against bodies of a scene, if there are any."""
        tool = config.tool.without_release()
        around = [self._make_clearance(tool, bodies=bodies, base_height_m=config.robot.base_height_m)] if bodies else []
        return [self._make_clearance(tool), *around]

    def _model_order(self, values: NDArray[np.float64]) -> NDArray[np.float64]:
        """Put values of joints, along the last axis, into the order of the model."""
        ordered = np.empty_like(values)
        ordered[..., self._columns] = values
        return ordered


def _describe_shapes(config: Config) -> object:
    """Make what is equal for trials whose tool and bodies have the same shapes and places."""
    return config.tool.without_release(), config.scene.bodies, config.task.bodies, config.robot.base_height_m


def _join(trajectories: Sequence[JointTrajectory]) -> tuple[JointTrajectory, NDArray[np.float64], NDArray[np.intp]]:
    """Join trajectories to one, with a pause of a second after each; list all instants to check, and their numbers."""
    ends = np.array([each.times[-1] for each in trajectories])
    counts = np.maximum(_CHECKED_LEAST, np.ceil(ends * _CHECKED_HZ)).astype(np.intp) + 1
    begins, steps = np.cumsum(ends + 1) - ends, ends / (counts - 1)
    times = np.concatenate([np.arange(n) * step + begin for n, step, begin in zip(counts, steps, begins, strict=True)])
    knots = np.concatenate([each.times + begin for each, begin in zip(trajectories, begins, strict=True)])
    points = ([getattr(each, name) for each in trajectories] for name in ("positions", "velocities", "accelerations"))
    return JointTrajectory(trajectories[0].joints, knots, *map(np.concatenate, points)), times, counts


def _sample(
    joints: Sequence[str],
    trajectory: JointTrajectory,
    times: NDArray[np.float64],
    rest: NDArray[np.float64],
    offsets: NDArray[np.float64],
    speed: NDArray[np.float64] | float,
) -> Motion:
    """Sample the motion of joints, each array of shape ``(n, n_joints)``; the trajectory moves all or some of them.

    The others stay where they are in `rest`, which is overwritten. True angles are larger than those of the trajectory
    by `offsets`, ``(n_joints,)`` or a row for each instant, and true speeds by the factor `speed`.
    """
    columns = [joints.index(joint) for joint in trajectory.joints]
    whole = rest, np.zeros_like(rest), np.zeros_like(rest)
    position, velocity, acceleration = sample_quintic(trajectory, times)
    # At another speed, the joints pass the same angles, so each derivative by time has one more factor of the speed.
    sampled = position + offsets[..., columns], velocity * speed, acceleration * speed**2
    for array, values in zip(whole, sampled, strict=True):
        array[:, columns] = values
    return whole


def _choose_rows(positions: NDArray[np.float64]) -> NDArray[np.intp]:
    """Choose rows between which some joint moves by `_CLEARANCE_STEP_RAD`, with the first and the last row."""
    # The largest moves from row to row are added up, so that slow parts of a motion need few checks.
    travel = np.cumsum(np.abs(np.diff(positions, axis=0)).max(axis=1))
    passed = np.diff(np.floor(travel / _CLEARANCE_STEP_RAD), prepend=0.0) > 0
    passed[-1] = True
    return np.append(0, np.flatnonzero(passed) + 1)


def _find_worst(values: NDArray[np.float64], limits: NDArray[np.float64]) -> tuple[int, int] | None:
    """Find row and column of the largest magnitude over its limit; None if no limit is exceeded."""
    shares = shares_of(values, limits)
    row, column = np.unravel_index(int(np.argmax(shares)), shares.shape)
    return (int(row), int(column)) if shares[row, column] > 1 else None


def _describe_gap(distance_m: float) -> str:
    return "overlap" if distance_m < 0 else f"are {distance_m * 1000:.1f} mm apart"
