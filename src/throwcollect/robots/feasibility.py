"""Checks joint trajectories: whether limits are kept, the robot is clear of itself, and the tool holds the ball."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from throwcollect.config.schema import Config
from throwcollect.engines.body import Placement
from throwcollect.engines.engine import SceneBody
from throwcollect.pinocchio_library import pinocchio
from throwcollect.robots.clearance import MARGIN_M, Clearance, find_overlap
from throwcollect.robots.description import (
    check_names,
    find_locked_joints,
    joint_offsets,
    robot_of,
    start_posture,
)
from throwcollect.robots.joint_model import joint_model, lock_joints, mount_of
from throwcollect.robots.limits import joint_limits, shares_of
from throwcollect.robots.quintic_curve import sample_quintic
from throwcollect.robots.robot import Robot
from throwcollect.robots.surroundings import bodies_of, object_of, starts_in_tool
from throwcollect.robots.trajectory import JointTrajectory
from throwcollect.tools.tool import Tool, tool_of

_CHECKED_HZ = 100
_CHECKED_LEAST = 100
_CLEARANCE_STEP_RAD = 0.02
_POSITION_SLACK_RAD = 1e-6
_LOWEST_WAY_OUT_RAD = -0.02
"""A way out that goes down by less than this counts as level, because a ball takes a second or more to leave on it."""
_SURELY = 1 - 1e-6
"""A torque below this share of its limit is within the limit by any model: results of models agree to 1e-12."""


Motion = tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]
"""Positions [rad], velocities [rad/s] and accelerations [rad/s²], each of shape ``(n, n_joints)``, in the order of
`Robot.joints`."""


class Feasibility:
    """Checks joint trajectories against the limits of a robot.

    One object serves all trials of a collection: each check sets posture, masses, gravity and limits of its trial. Only
    a trial with another tool takes longer, because pairs of shapes are built anew.

    Raises:
        ConfigError: If the robot's files cannot be read, or lack something.
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
        self._limits = joint_limits(self._robot)
        self._dynamics = Dynamics(self._robot, self._model, {})
        self._locked: Mapping[str, float] = {}
        self._free_dynamics = self._dynamics
        self._tool_config, self._tool = config.tool.without_release(), tool_of(config)
        check_names(config, self._robot, self._tool)
        self._clearance = Clearance(self._robot, self._model, self._tool)
        self._around: dict[tuple[tuple[SceneBody, ...], float], Clearance] = {}

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
            that has to stay. For limits, it tells the worst violation; for collisions, the first one.
        """
        posture = np.array(list(start_posture(config).values())) + joint_offsets(config)
        joints, tool = self._robot.joints, self._tool_of(config)
        instants = max(_CHECKED_LEAST, math.ceil(trajectory.times[-1] * _CHECKED_HZ)) + 1
        times = np.linspace(0.0, trajectory.times[-1], instants)
        motion = _sample_whole_body(self._robot, trajectory, times, posture, config)
        if violation := self._find_violation(config, times, motion):
            return violation
        positions = motion[0]
        rows = _choose_rows(positions)
        way = self._model_order(positions[rows])
        bodies = bodies_of(config)
        if overlap := self._find_overlap(config, tool, bodies, way[:1]):
            return overlap
        around = self._find_around(config, tool, bodies)
        if approach := self._clearance.first_approach(way) or (around and around.first_approach(way)):
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

    def _find_violation(self, config: Config, times: NDArray[np.float64], motion: Motion) -> str | None:
        """Find the first kind of limit that a motion violates, and the worst violation of it."""
        joints, locked = self._robot.joints, find_locked_joints(config)
        positions, velocities, _ = motion
        limits = self._limits
        # About the middle of its range, a joint has one limit in both directions.
        middle, half = (limits.upper + limits.lower) / 2, (limits.upper - limits.lower) / 2
        if worst := _find_worst(positions - middle, half + _POSITION_SLACK_RAD):
            row, joint = worst
            unit = self._robot.unit_of(joints[joint])
            side, limit = ("upper", limits.upper) if positions[worst] > middle[joint] else ("lower", limits.lower)
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
        limit = np.where([joint in locked for joint in joints], np.inf, limits.effort * config.robot.effort_scale)
        # The model without locked joints is faster and decides most trials. A trial near a limit is computed again
        # with all joints, so that its numbers do not depend on which joints are locked.
        tool = self._tool_of(config)
        efforts = self._dynamics_of_free_joints(locked).efforts(config, tool, motion)
        if (shares_of(efforts, limit) <= _SURELY).all():
            return None
        efforts = self._dynamics.efforts(config, tool, motion)
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
        tool, radius = self._tool_of(config), object_of(config).radius_m
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

    def _dynamics_of_free_joints(self, locked: Mapping[str, float]) -> Dynamics:
        """Return the dynamics of all joints but locked ones."""
        if locked != self._locked:
            self._locked, self._free_dynamics = dict(locked), Dynamics(self._robot, self._model, locked)
        return self._free_dynamics

    def _tool_of(self, config: Config) -> Tool:
        """Return the tool of a trial; if it differs from that of the previous trial, `_clearance` gets its shapes."""
        if config.tool.without_release() != self._tool_config:
            self._tool_config, self._tool = config.tool.without_release(), tool_of(config)
            self._clearance = Clearance(self._robot, self._model, self._tool)
            self._around.clear()
        return self._tool

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
        elif beside := self._find_around(config, tool, (thing,)):
            # Later, the robot may touch the object.
            approach = beside.first_approach(start)
            if approach is not None and approach.distance_m < 0:
                return f"{' and '.join(approach.links)} overlap at the start"
        return find_overlap((thing, *bodies))

    def _find_around(self, config: Config, tool: Tool, bodies: tuple[SceneBody, ...]) -> Clearance | None:
        """Return what checks the robot against bodies of a trial's scene; None if there are none."""
        height = config.robot.base_height_m
        if bodies and (bodies, height) not in self._around:
            if len(self._around) > 1:
                self._around.clear()
            made = Clearance(self._robot, self._model, tool, bodies=bodies, base_height_m=height)
            self._around[bodies, height] = made
        return self._around.get((bodies, height))

    def _model_order(self, values: NDArray[np.float64]) -> NDArray[np.float64]:
        """Put values of joints, along the last axis, into the order of the model."""
        ordered = np.empty_like(values)
        ordered[..., self._columns] = values
        return ordered


def _sample_whole_body(
    robot: Robot, trajectory: JointTrajectory, times: NDArray[np.float64], posture: NDArray[np.float64], config: Config
) -> Motion:
    """Sample the motion of all joints, each array of shape ``(n, n_joints)``, in the order of `Robot.joints`."""
    columns = [robot.joints.index(joint) for joint in trajectory.joints]
    offsets, speed = joint_offsets(config)[columns], config.robot.speed_scale
    whole = tuple(np.tile(rest, (len(times), 1)) for rest in (posture, np.zeros_like(posture), np.zeros_like(posture)))
    position, velocity, acceleration = sample_quintic(trajectory, times)
    # At another speed, the joints pass the same angles, so each derivative by time has one more factor of the speed.
    for array, sampled in zip(whole, (position + offsets, velocity * speed, acceleration * speed**2), strict=True):
        array[:, columns] = sampled
    return whole[0], whole[1], whole[2]


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


class Dynamics:
    """Inverse dynamics of a robot.

    Args:
        robot: The robot.
        model: Model of all its joints, without a tool.
        locked: Angle [rad] of each joint that is locked, which makes computing faster; empty if none is.
    """

    def __init__(self, robot: Robot, model: pinocchio.Model, locked: Mapping[str, float]) -> None:
        self._model = lock_joints(model, locked) if locked else model.copy()
        self._data = self._model.createData()
        # Columns of `Robot.joints` that are not locked, in the order of the model.
        self._columns = np.array([robot.joints.index(name) for name in list(self._model.names)[1:]], dtype=np.intp)
        hand = self._model.frames[self._model.getFrameId(robot.hand, pinocchio.BODY)]
        self._robot = robot
        self._hand, self._hand_placement = hand.parentJoint, hand.placement.copy()
        self._bare_hand = self._model.inertias[self._hand].copy()
        self._damping = joint_limits(robot).damping[self._columns]

    def efforts(self, config: Config, tool: Tool, motion: Motion) -> NDArray[np.float64]:
        """Compute the torques that a motion of all joints needs, with tool and ball of a trial in the hand.

        In the motion, locked joints must rest at the angles at which they are locked.

        Returns:
            [Nm], shape ``(n, n_joints)``, in the order of `Robot.joints`; 0 for locked joints.
        """
        load = tool.inertia
        if starts_in_tool(config):
            thing = object_of(config)
            seat, inertia = np.array(tool.ball_seat(thing.radius_m)), thing.inertia
            held = pinocchio.Inertia(inertia.mass_kg, np.zeros(3), np.diag(inertia.diagonal))
            load += pinocchio.SE3(np.eye(3), seat).act(held)
        # The sum begins with the bare hand, because the model still holds the load of the previous trial.
        self._model.inertias[self._hand] = self._bare_hand + (self._hand_placement * mount_of(self._robot, tool)).act(
            load
        )
        self._model.gravity.linear = np.array([0.0, 0.0, -config.scene.gravity_mps2])
        positions, velocities, accelerations = (np.ascontiguousarray(array[:, self._columns]) for array in motion)
        rows = zip(positions, velocities, accelerations, strict=True)
        torques = np.array([pinocchio.rnea(self._model, self._data, *row) for row in rows])
        needed = np.zeros_like(motion[0])
        # Pinocchio's inverse dynamics leave out friction.
        needed[:, self._columns] = torques + self._damping * velocities
        return needed
