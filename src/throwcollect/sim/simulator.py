"""One simulator: the world, the controllers of the limbs, the clock, and the trial that it simulates.

Replays, scores, the runtime in one process and Python programs call `Simulator.run`. The node of a simulation calls
`begin`, `step` and `hand_over` instead, because it answers messages between the steps.
"""

from __future__ import annotations

from collections.abc import Callable, Hashable, Iterable, Mapping
from dataclasses import replace
from weakref import finalize

import numpy as np
from numpy.typing import NDArray

from throwcollect.config.schema import Config
from throwcollect.config.values import with_values
from throwcollect.control.values import GoalResult, GoalStatus, TrajectoryGoal, TrajectoryRefusal
from throwcollect.episode.channels import Channels
from throwcollect.episode.episode_message import Episode
from throwcollect.episode.message_table import ChunkEncoder
from throwcollect.episode.record import ControllerSamples, EpisodeHeader, GoalOutcome, Samples, find_infinite_columns
from throwcollect.errors import ThrowcollectError
from throwcollect.members import explain_failure
from throwcollect.plan.conditions import Settings
from throwcollect.plan.trials import NO_TARGET, Trial, Values
from throwcollect.robots.description import full_description, robot_of, start_posture
from throwcollect.sensing.recorder import SensorRecorder
from throwcollect.sim.limb_controller import LimbController
from throwcollect.sim.policy import Policy, PolicyLoop, make_policy
from throwcollect.sim.present_trial import PresentTrial, trial_goals
from throwcollect.sim.world import World
from throwcollect.tasks.task import task_of, trajectory_of
from throwcollect.units import NS_PER_S

STRETCH_S = 1.0
"""Simulated time that is stepped in one call: some 10 ms of real time with MuJoCo, and 20 with Bullet."""


class Simulator:
    """Simulates trials of one configuration, one after the other; an episode depends on its trial alone, bit for bit.

    Args:
        config: The configuration.
        policy: Policy in the place of the one that the configuration names.
        on_frame: Called after each rendered frame of a sensor; None if episodes are to have no frames.

    Attributes:
        config: The configuration; a trial replaces some of its values.
        loop: Lets the policy of the configuration command the joints; None if it has none.
        channels: The topics that are recorded of a trial.
        world: The world: engine, robot, bodies and clock.
        limbs: The controllers, by name.
        trial: The trial that is simulated, and the one that the next reset begins.
        close: Frees the world, as the end of this object does, too; no trial can be run afterwards.

    Raises:
        ConfigError: If the configuration does not describe a world.
        WorkerError: If the physics engine does not start.
    """

    def __init__(
        self, config: Config, policy: Policy | None = None, *, on_frame: Callable[[], None] | None = None
    ) -> None:
        self._on_frame = on_frame
        self.world = World(config)
        self.close = finalize(self, self.world.close)
        # This is not called when the process ends, which frees all worlds, because engines may be unloaded by then.
        self.close.atexit = False
        self.trial = PresentTrial(config)
        self._period_ns = round(NS_PER_S / config.sim.physics_hz)
        self._stride = config.sim.physics_hz // config.record.rate_hz
        robot = robot_of(config)
        self.limbs = {
            name: LimbController(
                robot, name, moving=self.world.moving, period_ns=self._period_ns, config=config.controllers
            )
            for name in robot.controllers
        }
        self._watched: list[LimbController] = []
        """Limbs whose controllers look at the measured state in every step."""
        self._sent: list[NDArray[np.float64]] | None = None
        """Set points of the moving joints at the samples after the first, while a client records; otherwise None."""
        self._keeps_states = "controller_state" in config.record.topics
        self._results: list[tuple[str, GoalResult]] = []
        try:
            self.use(config, policy)
            self.reset()
        except BaseException:
            self.close()
            raise

    def use(self, config: Config, policy: Policy | None = None) -> None:
        """Simulate a configuration from now on that differs from the present one at most in its policy.

        Args:
            config: The configuration.
            policy: Policy in the place of the one that it names.
        """
        self.config = config
        self.channels = Channels(config, full_description(config))
        self._settings = Settings(config)
        self._encoder = ChunkEncoder(self.channels, level=config.record.zstd_level)
        self._sensors = None if self._on_frame is None else SensorRecorder(self.channels, self._on_frame)
        self._columns = task_of(config).columns
        self.loop: PolicyLoop | None = None
        if config.task.policy is not None:
            self.loop = PolicyLoop(config, policy or make_policy(config), self.world)

    @property
    def now_ns(self) -> int:
        """Simulated time [ns]."""
        return self.world.stamp_ns

    def run(self, trial: Trial) -> Episode:
        """Simulate a trial, which need not be in a plan; return its episode, with its result and conditions."""
        self.begin(trial.number, trial.values, seed=trial.seed, target=trial.target)
        steps = round(STRETCH_S * self.config.sim.physics_hz)
        while (episode := self.hand_over()) is None:
            self.step(steps)
        self.pop_results()
        return episode

    def begin(self, number: int, values: Values, *, seed: int = 0, target: Values = NO_TARGET) -> None:
        """Begin a trial: controllers are as they are configured, and get the goals that follow from the trial.

        Args:
            number: Number of the trial.
            values: Values by dotted key, which replace the values of the configuration.
            seed: Seed of the trial, which a policy gets.
            target: Where the trial should end, by column, which a policy gets.
        """
        # If this trial cannot begin, the next episode must not be judged by what is left of an earlier trial.
        self.trial.motion = None
        config = with_values(self.config, values)
        motion = trajectory_of(config)
        goals = {} if self.loop else trial_goals(robot_of(config), motion, start_posture(config))
        for limb in self.limbs.values():
            limb.restore()
        self.trial.number, self.trial.config = number, config
        self.reset()
        self._in_trial = True
        for controller, goal in goals.items():
            # The id of a client's goal is a number. This id is none, so that no client gets the result of this goal.
            if (refusal := self.give(controller, ("trial", number), goal)) is not None:
                raise ThrowcollectError(f"trial {number}: {controller} refuses its goal: {refusal}")
        if self.loop is not None:
            self.loop.begin(config, number, seed, target)
        self.trial.motion = motion

    def drop(self) -> None:
        """Break off the trial that runs, and go back to the configuration."""
        self.trial.set_up_nothing()
        self.reset()

    def reset(self, *, time: bool = True, state: bool = True) -> None:
        """Go back to the start of the trial that is set up, in whole or in part; this aborts all goals.

        Args:
            time: Whether the clock goes to the start of the trial.
            state: Whether world and controllers go to the start state of the trial.
        """
        self._in_trial, self._sent = False, None
        self._goals: dict[str, GoalOutcome] = {}
        number, config = self.trial.number, self.trial.config
        start_ns = self.now_ns
        if time:
            # Each trial has a slot of time of its own, so that stamps in a dataset never overlap.
            start_ns = 0 if number < 0 else config.trial_start_ns(number)
        if state:
            self.world.reset(config, start_ns=start_ns)
            posture = start_posture(config)
        else:
            self.world.restart_clock(start_ns)
            posture = self.world.posture()
        for limb in self.limbs.values():
            limb.reset(start_ns, posture, speed=config.robot.speed_scale)
        self._collect_results()
        self._command = np.array([posture[joint] for joint in self.world.moving])

    def give(self, controller: str, goal_id: Hashable, goal: TrajectoryGoal) -> TrajectoryRefusal | None:
        """Give a goal to a controller; return its refusal, or None if the controller accepts the goal."""
        limb = self.limbs[controller]
        refusal = limb.refuse_locked(goal.trajectory) or limb.controller.submit(goal_id, goal, self.now_ns)
        self._collect_results()
        if refusal is None:
            self._goals[controller] = GoalOutcome(controller, GoalStatus.EXECUTING, 0, "")
        return refusal

    def step(self, steps: int) -> int:
        """Take physics steps, fewer if the trial ends, or outside of trials a goal; return how many were taken."""
        if not self._in_trial:
            self.world.forget_samples()
        remaining = steps
        while remaining > 0 and not (self._in_trial and self.world.end_reason is not None):
            remaining -= self._step_some(remaining)
            if self._results and not self._in_trial:
                # A client that waits for the result gets it before time goes on.
                break
        return steps - remaining

    def hand_over(self) -> Episode | None:
        """Return the episode of a trial that has ended, with its result, only once; None if there is none."""
        config, motion = self.trial.config, self.trial.motion
        if motion is None or (recording := self.take_recording()) is None:
            return None
        header, samples, states = recording
        # What clients do later starts from the configuration, and not from the values of this trial.
        self.trial.set_up_nothing()
        conditions = self._settings.conditions_of(self._settings.read_values(config), motion.digest)
        state, table = self._encoder.encode(samples, states)
        # The samples are judged as readers of the dataset see them: recorded velocities are in the frames of bodies.
        if (infinite := next(find_infinite_columns(table.samples), None)) is not None:
            raise ThrowcollectError(f"trial {header.trial}: {infinite}")
        # Writing finds results of a wrong kind. They are a fault of the task, too, so writing stands in this block.
        with explain_failure("tasks", config.task.name, f"judge trial {header.trial}"):
            result = self._columns.to_json(task_of(config).judge(table.samples, header, motion))
        # What sensors see follows from what is recorded, and is the same when it is rendered later.
        seen = self._sensors.record(config, header.trial, table.samples) if self._sensors else ()
        return Episode(header, state, sensors=seen, result=result, conditions=conditions)

    def take_recording(self) -> tuple[EpisodeHeader, Samples, Mapping[str, ControllerSamples]] | None:
        """Return what was recorded of a trial that has ended, only once; None while there is no such recording."""
        if not self._in_trial or (end_reason := self.world.end_reason) is None:
            return None
        begun, self._in_trial, self.trial.motion = self.trial.motion is not None, False, None
        samples = self.world.samples()
        if self.loop is not None and begun:
            samples = replace(samples, command=self.loop.commands(np.arange(len(samples)) * self._stride))
        header = EpisodeHeader(
            trial=self.trial.number,
            start_ns=int(samples.stamps_ns[0]),
            end_reason=end_reason,
            contacts=self.world.contacts(),
            goals=tuple(self._goals[name] for name in self.limbs if name in self._goals),
            samples=len(samples),
        )
        states = {}
        if self._keeps_states:
            # The last sample was recorded after controllers looked at the measured state for the last time.
            self._look(self.limbs.values())
            self._collect_results()
            states = {name: limb.collect_states() for name, limb in self.limbs.items()}
        return header, samples, states

    def pop_results(self) -> list[tuple[str, GoalResult]]:
        """Return controllers and results of the goals that have ended since the last call, oldest first."""
        results, self._results = self._results, []
        return results

    def _step_some(self, most: int) -> int:
        """Take at most `most` steps, so that a controller looks at the measured state when it has to."""
        moving = [limb for limb in self.limbs.values() if limb.is_driven]
        free = most
        if self._keeps_states:
            # Every controller looks at each sample; between samples there is nothing to keep.
            moving = list(self.limbs.values())
            phase = self.world.steps % self._stride
            free = min(free, self._stride - phase) if phase else 0
        if self._watched:
            moving += [limb for limb in self._watched if limb not in moving]
            free = 0
        for limb in moving:
            free = min(free, limb.controller.next_decision())
        loop = self.loop if self.trial.motion is not None else None
        if loop is not None:
            if (phase := self.world.steps % loop.stride) == 0:
                loop.ask()
            free = min(free, loop.stride - phase)
        if free > 0:
            commands = np.repeat(self._command[np.newaxis], free, axis=0)
            for limb in moving:
                limb.take(commands)
        else:
            self._look(moving)
            commands = self._command[np.newaxis].copy()
        if loop is not None:
            loop.fill(commands)
        self._command = commands[-1].copy()
        due = -(self.world.steps + 1) % self._stride
        taken = self.world.run(commands, stop_at_end=self._in_trial)
        if self._sent is not None:
            self._sent.append(commands[due : taken : self._stride])
        self._collect_results()
        return taken

    def _look(self, limbs: Iterable[LimbController]) -> None:
        """Let controllers see the measured state, for one control period."""
        positions, velocities = self.world.joints()
        keeps = self._keeps_states and self.world.steps % self._stride == 0
        for limb in limbs:
            limb.update(self.now_ns, limb.measure(positions, velocities), self._command)
            if keeps:
                limb.keep_state()

    def _collect_results(self) -> None:
        for name, limb in self.limbs.items():
            for result in limb.controller.pop_results():
                self._results.append((name, result))
                if name in self._goals:
                    self._goals[name] = GoalOutcome(name, result.status, result.error_code, result.error_string)
