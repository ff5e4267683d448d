"""The rules of a trial, on any physics engine: one robot with a tool, one object, from the start state to the end."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from throwcollect.config.schema import Config
from throwcollect.engines.as_described import check_loaded
from throwcollect.engines.body import BodyModel
from throwcollect.engines.engine import (
    BODY_NUMBERS,
    BodyState,
    Engine,
    Observer,
    Sample,
    Scene,
    SceneBody,
    State,
    Steps,
    body_of,
    object_in,
    split_bodies,
    to_numbers,
)
from throwcollect.episode.record import REST_S, REST_SPEED_MPS, Contact, EndReason, Samples
from throwcollect.errors import ConfigError
from throwcollect.extras import require_engine
from throwcollect.members import explain_failure, load_member
from throwcollect.robots.description import (
    Description,
    find_locked_joints,
    joint_offsets,
    physics_description,
    robot_of,
    start_posture,
)
from throwcollect.robots.tools.tool import tool_of
from throwcollect.sim.motors import Motors
from throwcollect.sim.recording import OBJECT_LINEAR_VELOCITY, ContactLog, SampleLog, to_samples
from throwcollect.sim.scene import drag_of, physics_of, scene_of, seat_of
from throwcollect.tasks.task import EndRule, task_of
from throwcollect.units import NS_PER_S


class World(Observer):
    """The world of one simulation, used for one trial after the other.

    `reset` puts it into the start state of a trial, which is a pure function of the trial's configuration, bit for bit.
    `run` then takes physics steps until the trial ends:

    - ``landed``: by the rule of the task (`Task.end_rule`), by default when the object has crossed the landing plane;
    - ``rest``: the arm has moved and stands still, and the object has been lying on something for half a second;
    - ``timeout``: the longest duration is over.

    A trial ends with a sample, so that the recorded samples enclose the crossing.

    Args:
        config: Configuration of the first trial; it names the engine of all trials.

    Attributes:
        engine: The physics engine.
        moving: Names of the joints that are simulated and commanded, in the order of `Robot.joints`.
        steps: Number of physics steps taken in this trial.
        end_reason: Why the trial ended: ``landed``, ``rest`` or ``timeout``; None while it goes on.
        may_rest: Whether this trial goes on when arm and object rest.
        touching: Names of what presses on the object now.
        physics_hz: Physics steps per simulated second.

    Raises:
        ConfigError: If the configuration does not describe a world (see `reset`).
        MemberError: If the engine comes from another package and fails, which `reset` and `run` may find, too.
        MissingExtraError: If the physics engine is not installed.
        WorkerError: If the physics engine does not start.
    """

    steps: int
    end_reason: EndReason | None
    may_rest: bool
    _sampled_object: Sequence[float]
    _ends: EndRule
    touching: frozenset[str]
    _sampled_target: Sequence[float] | NDArray[np.float64]

    def __init__(self, config: Config) -> None:
        self._name = config.sim.engine
        require_engine(self._name)
        kind = load_member("engines", self._name)
        with explain_failure("engines", self._name, "be made"):
            self.engine: Engine = kind()
        self._joints = robot_of(config).joints
        self._described: tuple[object, Description] | None = None
        self._start_key: object = None
        self._compared: BodyModel | None = None
        try:
            self.reset(config)
        except BaseException:
            self.close()
            raise

    def close(self) -> None:
        """Free what the engine holds; the world cannot be used afterwards."""
        self.engine.close()

    @property
    def stamp_ns(self) -> int:
        """Simulated time now [ns]."""
        return self._stamp_ns(self.steps)

    @property
    def recorded(self) -> int:
        """Number of samples recorded in this trial, the start state included."""
        return len(self._log)

    def reset(self, trial: Config, *, start_ns: int = 0) -> None:
        """Put the world into the start state of a trial and record it as the first sample.

        This is cheap if the trial has the physics and the start posture of the previous trial. Otherwise the object
        settles anew, and if the robot, its tool, or the locked joints have changed, everything is loaded anew.

        Args:
            trial: Configuration of the trial.
            start_ns: Simulated time of the start state [ns].
        """
        # Of `task.end`, only the names of joints count, because they say which joints are locked.
        bodies = trial.task.bodies
        key = (
            *(trial.robot, trial.tool.without_release(), trial.ball, trial.object, trial.scene, trial.sim),
            *(trial.task.start, tuple(trial.task.end), bodies),
        )
        if key != self._start_key:
            # If settling fails, the next trial must not take the present state for its start state.
            self._start_key = None
            with explain_failure("engines", self._name, "begin a trial"):
                self._settle(trial)
            self._start_key = key
        with explain_failure("engines", self._name, "begin a trial"):
            self.engine.reset(self._settled)
        sim = trial.sim
        self.physics_hz = sim.physics_hz
        self._stride = sim.physics_hz // trial.record.rate_hz
        self._last_step = math.ceil(sim.max_trial_s * sim.physics_hz)
        task = task_of(trial)
        self._ends, self._plane_m = task.end_rule(), task.end_height_m
        self._drag = drag_of(trial)
        self._release_step = round((tool_of(trial).release_s or 0.0) * sim.physics_hz)
        self._motors = self._make_motors(trial)
        self.touching = self._settled.touching
        self._begin(start_ns, self._settled.sample)

    def restart_clock(self, start_ns: int) -> None:
        """Begin a new record at time `start_ns` [ns], without steps and contacts; the present state stays as it is."""
        now = self.engine.state
        self.touching = now.touching
        self._begin(start_ns, now.sample)

    def run(self, commands: NDArray[np.float64], *, stop_at_end: bool = True) -> int:
        """Take one physics step for each command, or fewer if the trial ends.

        Args:
            commands: For each step, the position of each moving joint wanted at its end [rad], shape
                ``(n_steps, n_moving)``.
            stop_at_end: Whether to take no more steps once the trial has ended. Otherwise the ground stops the object.

        Returns:
            Number of steps taken.
        """
        if stop_at_end and self.end_reason is not None:
            return 0
        first, self._first_step = self.steps, self.steps
        self._stops_at_end = stop_at_end
        # Commands are angles that sensors should show, but motors follow true angles.
        targets, velocities = self._motors.plan(commands + self._offsets)
        steps = Steps(
            targets,
            velocities,
            first_sample=self._stride - first % self._stride,
            stride=self._stride,
            drag_kgpm=self._drag,
            ground_is_solid=not stop_at_end,
            held=max(0, self._release_step - first),
            plane_m=self._plane_m,
        )
        # The arm stands still at a sample if its target is that of the sample before.
        due, recorded = targets[steps.first_sample :: self._stride], self.recorded
        self._still = iter((due == np.vstack((self._sampled_target, due[:-1]))).all(axis=1).tolist())
        with explain_failure("engines", self._name, "take steps"):
            taken = self.engine.run(steps, self)
        if sampled := self.recorded - recorded:
            self._sampled_target = due[sampled - 1]
        self.steps = first + taken
        self._motors.advance(taken)
        return taken

    def on_touch(self, step: int, bodies: frozenset[str]) -> None:
        """Note the bodies that press on the object since a step of the present `run`."""
        self.touching = bodies
        self._contacts.update(bodies, self._first_step + step)

    def on_sample(self, step: int, sample: Sample) -> bool:
        """Record a sample after a step of the present `run`, and tell whether the run is over."""
        end = self._find_end((step,), (sample[-BODY_NUMBERS:],))
        self._log.append(sample)
        return end is not None

    def on_samples(self, steps: range, samples: NDArray[np.float64]) -> int | None:
        """Record samples after steps of the present `run`, and tell with which one it is over."""
        end = self._find_end(steps, samples[:, -BODY_NUMBERS:].tolist())
        self._log.extend(samples if end is None else samples[: end + 1])
        return end

    def _find_end(self, steps: Sequence[int], objects: Iterable[Sequence[float]]) -> int | None:
        """Judge the object in samples, between which nothing else presses on it; find the one that ends the run."""
        first, ends, bodies, last_step = self._first_step, self._ends, self._contacts.bodies, self._last_step
        # As stamps are computed from numbers of samples, no other sample than the one that is due may be recorded.
        if (got := first + steps[0]) != (due := len(self._log) * self._stride):
            raise ValueError(f"sample {len(self._log)} should be of step {due}, not {got}")
        before = self._sampled_object
        for number, (step, now, stands_still) in enumerate(zip(steps, objects, self._still, strict=False)):
            self.steps = taken = first + step
            self._has_moved |= not stands_still
            if not (stands_still and bodies and math.hypot(*now[OBJECT_LINEAR_VELOCITY]) < REST_SPEED_MPS):
                self._resting_since = taken
            reason = ends(before, now, bodies)
            if reason is None and self._has_moved and stands_still and self.rests and not self.may_rest:
                reason = "rest"
            self.end_reason = self.end_reason or reason or ("timeout" if taken >= last_step else None)
            self._sampled_object = before = now
            if self._stops_at_end and self.end_reason is not None:
                return number
        return None

    def samples(self, first: int = 0) -> Samples:
        """Return recorded samples as arrays, from number `first` on; forgotten samples are left out."""
        first = max(first, self._log.forgotten)
        steps = np.arange(first, self.recorded, dtype=np.int64) * self._stride
        # Each stamp is computed from its step, because sums of periods would drift: a period may be no whole number of
        # nanoseconds.
        stamps = self._start_ns + steps * NS_PER_S // self.physics_hz
        return to_samples(self._log.table(first), stamps, self._joints, self.moving, self._locked, self._offsets)

    def forget_samples(self) -> None:
        """Drop all recorded samples but the last one, so that a world can go on for ever; numbers of samples stay."""
        self._log.forget()

    def contacts(self) -> tuple[Contact, ...]:
        """List all intervals in which something pressed on the object, by start time."""
        return self._contacts.intervals(self._stamp_ns)

    def joints(self) -> tuple[Sample, Sample]:
        """Measure the position [rad] and the velocity [rad/s] of each moving joint now, as its sensor shows them."""
        count, sample = len(self.moving), self.engine.state.sample
        shown = tuple((np.array(sample[:count]) - self._offsets).tolist()) if self._offsets.any() else sample[:count]
        return shown, sample[count : 2 * count]

    def posture(self) -> Mapping[str, float]:
        """Measure the position of each joint of the robot now [rad], as its sensor shows it."""
        return {**self._locked, **dict(zip(self.moving, self.joints()[0], strict=True))}

    @property
    def bodies(self) -> Mapping[str, BodyState]:
        """The object and all other bodies now, by name, with the object first."""
        sample, still = self.engine.state.sample, (body for body in self._scene.bodies if not body.moves)
        others = split_bodies(sample, len(self.moving))
        states = (object_in(sample), *map(body_of, others))
        fixed = {body.link.name: body_of(body.start) for body in still}
        return {**dict(zip(self.free, states, strict=True)), **fixed}

    @property
    def free(self) -> tuple[str, ...]:
        """Names of the bodies that move, with the object first."""
        return tuple(body.link.name for body in (self._scene.object, *self._scene.moving_bodies))

    def place(self, name: str, state: BodyState) -> None:
        """Set pose and velocity of a body that moves; before the first step, the start state is recorded anew."""
        self.engine.place(self.free.index(name), state)
        if self.steps == 0:
            self._record_start()

    def set_spawned(self, spawned: Iterable[SceneBody]) -> None:
        """Let these bodies stand in the world besides those of the trial, until the next `reset`; begin a new record.

        All that stays is where it is now. If the engine takes no such bodies, nothing changes.
        """
        bodies = (*self._own_bodies, *spawned)
        before, scene, states = self.engine.state, self._scene, self.bodies
        joints, thing = before.sample[: 3 * len(self.moving)], before.sample[-BODY_NUMBERS:]
        starts = [
            to_numbers(states[each.link.name]) if each.link.name in states else each.start
            for each in bodies
            if each.moves
        ]
        # The next trial loads its own scene.
        self._start_key = None
        with explain_failure("engines", self._name, "place bodies"):
            try:
                self._put(replace(scene, bodies=bodies), replace(before, sample=sum(starts, joints) + thing))
            except ConfigError:
                self._put(scene, before)
                raise
        self._release_step = max(0, self._release_step - self.steps)
        self.restart_clock(self.stamp_ns)

    def _put(self, scene: Scene, state: State) -> None:
        self.engine.load(scene)
        self._scene = scene
        self.engine.configure(self._physics)
        self.engine.reset(state)

    @property
    def rests(self) -> bool:
        """Whether the arm has been standing still, and the object lying on something, for half a second."""
        return self.steps - self._resting_since >= REST_S * self.physics_hz

    def _begin(self, start_ns: int, present: Sample) -> None:
        """Begin to count from the present state."""
        self._start_ns = start_ns
        self.steps = 0
        self._first_step = 0
        self._start_joints = present[: 3 * len(self.moving)]
        self._record_start()
        self._contacts = ContactLog()
        self._contacts.update(self.touching, 0)
        self._sampled_target = self._motors.target
        self._has_moved = False
        self._resting_since = 0
        self.end_reason = None
        self.may_rest = False

    def _settle(self, trial: Config) -> None:
        """Let the object come to rest where it starts, with the robot still, and keep that state."""
        description = self._describe(trial)
        scene = scene_of(trial, description)
        self.engine.load(scene)
        self._scene, self._own_bodies = scene, scene.bodies
        # The robot as it was loaded stays, while only the object is another one.
        if scene.robot != self._compared:
            check_loaded(self.engine, self._name, scene)
            self._compared = scene.robot
        self.moving, self._locked = description.moving, description.locked
        posture = start_posture(trial)
        offsets = dict(zip(self._joints, joint_offsets(trial).tolist(), strict=True))
        self._offsets = np.array([offsets[joint] for joint in self.moving])
        self._start = [posture[joint] + offsets[joint] for joint in self.moving]
        self._physics = physics_of(trial, self.moving)
        self.engine.configure(self._physics)
        self.engine.rest(self._start, seat_of(trial))
        # At least one step is taken, because contact forces and motor torques are known only after a step.
        steps = max(1, round(trial.sim.settle_s * trial.sim.physics_hz))
        targets, velocities = self._make_motors(trial).plan(np.tile(self._start, (steps, 1)))
        # The first sample is due one step after the last step, so no sample is recorded.
        self.engine.run(Steps(targets, velocities, first_sample=steps + 1, stride=1, held=steps), Observer())
        # What has a velocity at the start has not moved meanwhile.
        for number, body in enumerate((self._scene.object, *self._scene.moving_bodies)):
            if any(body.velocity):
                start = body_of(body.start)
                self.engine.place(number, replace(start, linear_velocity=body.velocity))
        self._settled = self.engine.state

    def _describe(self, trial: Config) -> Description:
        """Describe the robot for a trial; the description of the previous trial is kept while it is the same."""
        key = (trial.tool.without_release(), find_locked_joints(trial))
        if self._described is None or self._described[0] != key:
            self._described = key, physics_description(trial)
        return self._described[1]

    def _make_motors(self, trial: Config) -> Motors:
        robot, sim = trial.robot, trial.sim
        return Motors(self._start, hz=sim.physics_hz, delay_s=sim.command_delay_s, lag_s=robot.motor_lag_s)

    def _record_start(self) -> None:
        # The motor torques are taken from the settled state, because engines have none before the first step.
        sample = (*self._start_joints, *self.engine.state.sample[len(self._start_joints) :])
        self._log, self._sampled_object = SampleLog(sample), sample[-BODY_NUMBERS:]

    def _stamp_ns(self, step: int) -> int:
        return self._start_ns + step * NS_PER_S // self.physics_hz
