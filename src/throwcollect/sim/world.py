"""The physics of a trial: one robot with a spoon, one ball, from the start state to the end."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import pybullet
from numpy.typing import NDArray

from throwcollect.config.schema import Config
from throwcollect.episode.record import Contact, EndReason, Samples
from throwcollect.robots.description import locked_joints, physics_description, start_posture
from throwcollect.robots.spoon import ball_seat
from throwcollect.sim.bullet import BASE, Box, boxes, connect, load_ball, load_scenery, renew_pairs, set_physics
from throwcollect.sim.contacts import ContactLog, Surface
from throwcollect.sim.motors import Motors
from throwcollect.sim.recording import (
    BALL_HEIGHT,
    BALL_LINEAR_VELOCITY,
    BodyState,
    Row,
    Sample,
    to_sample,
    to_samples,
)
from throwcollect.sim.spawned import SpawnedBodies

_NS_PER_S = 1_000_000_000
_REST_S = 0.5
_REST_SPEED = 0.01
_ANY_BODY, _ANY_LINK = -1, -2


class World:
    """One Bullet world in this process, used for one trial after the other.

    `reset` puts it into the start state of a trial, which is a pure function of the trial's configuration, bit for bit.
    `run` then takes physics steps until the trial ends:

    - ``landed``: the ball's lowest point has crossed the landing plane downwards, out of the spoon;
    - ``rest``: the arm has moved and stands still, and the ball has been lying on something for half a second;
    - ``timeout``: the longest duration is over.

    A trial ends with a sample, so that the recorded samples enclose the crossing. On a landing plane at height zero the
    trial ends before the ground could stop the ball; the ground is there for planes above it.

    Args:
        config: Configuration of the first trial.

    Raises:
        ConfigError: If the configuration does not describe a world (see `reset`).
        WorkerError: If Bullet refuses to start another world in this process.
    """

    _ball: int
    _steps: int
    _contacts: ContactLog
    _end_reason: EndReason | None
    _settled: Row
    _settled_pressing: set[Surface]
    _pressing: set[Surface]
    _sampled_target: Sequence[float]
    _rows: list[Sample]
    _forgotten: int

    def __init__(self, config: Config) -> None:
        self._client = connect()
        self._names: dict[Surface, str] = {}
        self.spawned = SpawnedBodies(self._client, self._names)
        self._scenery_key: object = None
        self._start_key: object = None
        self._radius = math.nan
        self.reset(config)

    def close(self) -> None:
        """Free the world; it cannot be used afterwards."""
        pybullet.disconnect(self._client)

    @property
    def moving(self) -> tuple[str, ...]:
        """Names of the joints that are simulated and commanded, in the order of `talos.JOINTS`."""
        return self._moving

    @property
    def stamp_ns(self) -> int:
        """Simulated time now [ns]."""
        return self._stamp_ns(self._steps)

    @property
    def steps(self) -> int:
        """Number of physics steps taken in this trial."""
        return self._steps

    @property
    def recorded(self) -> int:
        """Number of samples recorded in this trial, the start state included."""
        return self._forgotten + len(self._rows)

    def reset(self, trial: Config, *, start_ns: int = 0) -> None:
        """Put the world into the start state of a trial and record it as the first sample.

        Cheap if the trial has the physics and the start posture of the one before; otherwise the ball settles anew,
        and if the robot, its tool, or what is locked has changed, all is loaded anew.

        Args:
            trial: Configuration of the trial.
            start_ns: Simulated time of the start state [ns].

        Raises:
            ConfigError: If the posture or the choice of locked joints is wrong, the ball falls through the spoon, or
                the robot's files cannot be read.
        """
        key = (trial.robot, trial.tool, trial.ball, trial.scene, trial.sim, trial.task.start, tuple(trial.task.end))
        self.spawned.friction = trial.scene.spoon_friction
        if key != self._start_key or self.spawned.leaves_traces:
            self._start_key = None
            try:
                self._load(trial)
                self._settle(trial)
            finally:
                self.spawned.load()
            self._start_key = key
        self._place(self._settled)
        sim, ball = trial.sim, trial.ball
        self._base_height = trial.robot.base_height_m
        self._hz = sim.physics_hz
        self._stride = sim.physics_hz // trial.record.rate_hz
        self._last_step = math.ceil(sim.max_trial_s * sim.physics_hz)
        self._landing_height = trial.scene.landing_height_m + ball.radius_m
        self._drag = ball.drag_coefficient * trial.scene.air_density_kgpm3 * math.pi * ball.radius_m**2 / 2
        self._motors = self._make_motors(trial)
        self._pressing = self._settled_pressing
        self._begin(start_ns, self._settled.joints)

    def restart_clock(self, start_ns: int) -> None:
        """Count time, steps, samples and contacts anew from the present state, which stays as it is.

        Args:
            start_ns: Simulated time of the present state [ns].
        """
        # Drop contacts with bodies that were removed since the last step.
        self._pressing = {surface for surface in self._pressing if surface in self._names}
        self._begin(start_ns, self._joint_states())

    @property
    def end_reason(self) -> EndReason | None:
        """Why the trial ended: ``landed``, ``rest`` or ``timeout``; None while it goes on."""
        return self._end_reason

    def run(self, commands: NDArray[np.float64], *, stop_at_end: bool = True) -> int:
        """Take one physics step for each command, or fewer if the trial ends.

        Args:
            commands: For each step, the position of each moving joint wanted at its end [rad], shape
                ``(n_steps, n_moving)``.
            stop_at_end: Whether to take no more steps once the trial has ended.

        Returns:
            Number of steps taken.
        """
        if stop_at_end and self._end_reason is not None:
            return 0
        # Local names, arguments by position and one loop: what stands here is paid for in every step.
        client, ball, rows = self._client, self._ball, self._rows
        aim, take_step, points_on = self._motors.aim, pybullet.stepSimulation, pybullet.getContactPoints
        first = step = self._steps
        stride = self._stride
        for before, velocity, target in self._motors.plan(commands):
            aim(before, velocity)
            if self._drag:
                self._apply_drag()
            take_step(client)
            step += 1
            # Bullet also lists points that are merely close; those have no normal force (field 9).
            points = points_on(ball, _ANY_BODY, _ANY_LINK, _ANY_LINK, client)
            pressing = {(point[2], point[4]) for point in points if point[9] > 0}
            if pressing != self._pressing:
                self._pressing = pressing
                self._contacts.update(pressing, step)
            if step % stride == 0:
                self._steps = step
                rows.append(to_sample(self._read()))
                self._end_reason = self._end_reason or self._judge(target)
                if stop_at_end and self._end_reason is not None:
                    break
        self._steps = step
        self._motors.advance(step - first)
        return step - first

    def samples(self, first: int = 0, last: int | None = None) -> Samples:
        """Recorded samples as arrays.

        Args:
            first: Number of the first sample; those that are forgotten are left out.
            last: Number after the last sample; None for all.
        """
        numbers = range(self.recorded)[max(first, self._forgotten) : last]
        steps = np.arange(numbers.start, numbers.stop, dtype=np.int64) * self._stride
        stamps = self._start_ns + steps * _NS_PER_S // self._hz
        rows = self._rows[numbers.start - self._forgotten : numbers.stop - self._forgotten]
        return to_samples(rows, stamps, self._moving, self._locked)

    def forget_samples(self) -> None:
        """Drop the recorded samples but the last two, so that a world can go on for ever; numbers go on counting."""
        self._forgotten += len(self._rows[:-2])
        self._rows = self._rows[-2:]

    def contacts(self) -> tuple[Contact, ...]:
        """All intervals in which something pressed on the ball, by start time."""
        return self._contacts.intervals(self._stamp_ns)

    def joint_positions(self) -> list[float]:
        """Position of each moving joint now [rad]."""
        return [state[0] for state in self._joint_states()]

    def joint_velocities(self) -> list[float]:
        """Velocity of each moving joint now [rad/s]."""
        return [state[1] for state in self._joint_states()]

    def posture(self) -> Mapping[str, float]:
        """Position of each of the 32 joints now [rad]."""
        return {**self._locked, **dict(zip(self._moving, self.joint_positions(), strict=True))}

    @property
    def robot_base(self) -> BodyState:
        """The base of the robot, which never moves."""
        return BodyState((0.0, 0.0, self._base_height))

    def ball_boxes(self) -> list[Box]:
        """A box along the axes of the world around the ball."""
        return boxes(self._client, self._ball)

    def robot_boxes(self) -> list[Box]:
        """Boxes along the axes of the world around the links of the robot."""
        return boxes(self._client, self._scenery.robot)

    @property
    def ball(self) -> BodyState:
        """The ball now; when set before the first step, the start state is recorded anew."""
        row = self._read()
        return BodyState(*row.pose, *row.twist)

    @ball.setter
    def ball(self, state: BodyState) -> None:
        pybullet.resetBasePositionAndOrientation(
            self._ball, state.position, state.orientation_xyzw, physicsClientId=self._client
        )
        pybullet.resetBaseVelocity(
            self._ball, state.linear_velocity, state.angular_velocity, physicsClientId=self._client
        )
        if self._steps == 0:
            self._record_start()

    def _begin(self, start_ns: int, joints: Sequence[tuple[Any, ...]]) -> None:
        """Begin to count from the present state, whose joints are recorded as given."""
        self._start_ns = start_ns
        self._steps = 0
        self._start_joints = joints
        self._record_start()
        self._contacts = ContactLog(self._names)
        self._contacts.update(self._pressing, 0)
        self._sampled_target = self._motors.target
        self._has_moved = False
        self._resting_since = 0
        self._end_reason = None

    def _load(self, trial: Config) -> None:
        """Load what differs from the trial before in shape: ground, robot and ball, or the ball alone."""
        solid_ground = trial.scene.landing_height_m > 0
        key = (trial.robot.base_height_m, trial.tool, locked_joints(trial), solid_ground)
        if key != self._scenery_key or self.spawned.leaves_traces:
            self._scenery_key = None
            self._radius = math.nan
            description = physics_description(trial)
            self.spawned.forget()
            self._scenery = load_scenery(
                self._client, description, base_height=trial.robot.base_height_m, solid_ground=solid_ground
            )
            self._moving, self._locked = description.moving, description.locked
            self._names.clear()
            self._names.update(self._scenery.names)
            self._scenery_key = key
        if self._radius != trial.ball.radius_m:
            if not math.isnan(self._radius):
                pybullet.removeBody(self._ball, physicsClientId=self._client)
            self._ball = load_ball(self._client, trial.ball.radius_m)
            self._radius = trial.ball.radius_m

    def _settle(self, trial: Config) -> None:
        """Find the state in which the ball has come to rest in the spoon of the still robot."""
        client, scenery = self._client, self._scenery
        seat = ball_seat(trial.tool, trial.ball.radius_m)
        posture = start_posture(trial)
        self._start = [posture[joint] for joint in self._moving]
        set_physics(client, scenery, self._ball, trial)
        for joint, angle in zip(scenery.joints, self._start, strict=True):
            pybullet.resetJointState(scenery.robot, joint, angle, physicsClientId=client)
        spoon = pybullet.getLinkState(
            scenery.robot, scenery.spoon, computeForwardKinematics=True, physicsClientId=client
        )
        centre, _ = pybullet.multiplyTransforms(spoon[4], spoon[5], seat, [0, 0, 0, 1])
        at_rest = BodyState(position=centre)
        self._place(
            Row(
                joints=[(angle, 0.0) for angle in self._start],
                pose=(at_rest.position, at_rest.orientation_xyzw),
                twist=(at_rest.linear_velocity, at_rest.angular_velocity),
            )
        )
        motors = self._make_motors(trial)
        # At least one step, as contact forces and motor torques are those of the last one.
        settling = np.tile(self._start, (max(1, round(trial.sim.settle_s * trial.sim.physics_hz)), 1))
        for position, velocity, _ in motors.plan(settling):
            motors.aim(position, velocity)
            pybullet.stepSimulation(physicsClientId=client)
        self._settled = self._read()
        points = pybullet.getContactPoints(self._ball, physicsClientId=client)
        self._settled_pressing = {point[2:5:2] for point in points if point[9] > 0}

    def _place(self, row: Row) -> None:
        """Put robot and ball into a state, leaving nothing behind of what went on before.

        Bullet's own snapshots do not achieve that: they keep pairs of shapes that once came close, and with them the
        order in which contacts are solved. `renew_pairs` forgets those.
        """
        for joint, state in zip(self._scenery.joints, row.joints, strict=True):
            pybullet.resetJointState(self._scenery.robot, joint, state[0], state[1], physicsClientId=self._client)
        renew_pairs(self._client, self._ball)
        pybullet.resetBasePositionAndOrientation(self._ball, *row.pose, physicsClientId=self._client)
        pybullet.resetBaseVelocity(self._ball, *row.twist, physicsClientId=self._client)

    def _record_start(self) -> None:
        # After a reset with the motor torques of the settled state: Bullet has none before the first step.
        self._rows = [to_sample(self._read()._replace(joints=self._start_joints))]
        self._forgotten = 0

    def _make_motors(self, trial: Config) -> Motors:
        scenery = self._scenery
        return Motors(self._client, scenery.robot, scenery.joints, moving=self._moving, start=self._start, config=trial)

    def _stamp_ns(self, step: int) -> int:
        return self._start_ns + step * _NS_PER_S // self._hz

    def _judge(self, target: Sequence[float]) -> EndReason | None:
        """Whether the trial ends with the sample just recorded, and why."""
        before, now = self._rows[-2:]
        if now[BALL_HEIGHT] < self._landing_height <= before[BALL_HEIGHT] and "spoon" not in self._contacts.bodies:
            return "landed"
        stands_still = target == self._sampled_target
        self._sampled_target = target
        self._has_moved |= not stands_still
        lies = stands_still and self._pressing and self._has_moved
        if not (lies and math.hypot(*now[BALL_LINEAR_VELOCITY]) < _REST_SPEED):
            self._resting_since = self._steps
        elif self._steps - self._resting_since >= _REST_S * self._hz:
            return "rest"
        return "timeout" if self._steps >= self._last_step else None

    def _apply_drag(self) -> None:
        position, _ = pybullet.getBasePositionAndOrientation(self._ball, physicsClientId=self._client)
        velocity, _ = pybullet.getBaseVelocity(self._ball, physicsClientId=self._client)
        factor = -self._drag * math.hypot(*velocity)
        force = [factor * component for component in velocity]
        pybullet.applyExternalForce(
            self._ball, BASE, force, position, pybullet.WORLD_FRAME, physicsClientId=self._client
        )

    def _joint_states(self) -> Sequence[tuple[Any, ...]]:
        states: Sequence[tuple[Any, ...]] = pybullet.getJointStates(
            self._scenery.robot, self._scenery.joints, self._client
        )
        return states

    def _read(self) -> Row:
        client, ball = self._client, self._ball
        return Row(
            self._joint_states(),
            pybullet.getBasePositionAndOrientation(ball, client),
            pybullet.getBaseVelocity(ball, client),
        )
