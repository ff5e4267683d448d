"""One simulation without its ROS interface: the world, the limbs' controllers, the clock, and the present run.

A *run* begins when goals have been accepted and ends with the trial, or, when no trial was set up, when all limbs are
at rest again. The clock stands still outside of runs, so that no step is wasted.
"""

from __future__ import annotations

import time
from collections.abc import Hashable, Iterable, Mapping
from dataclasses import dataclass
from enum import IntEnum

import numpy as np

from throwcollect.config.schema import Config
from throwcollect.control import ControllerState, GoalResult, Trajectory, TrajectoryGoal
from throwcollect.episode.record import ControllerSamples, EpisodeHeader, GoalOutcome, Samples
from throwcollect.robots.description import start_posture
from throwcollect.robots.talos import CONTROLLERS
from throwcollect.sim.limb import Limb
from throwcollect.sim.recording import BallState
from throwcollect.sim.world import World

_NO_TRIAL = -1
_SLICE_S = 0.5
"""Simulated time between two looks at the inputs: about 20 ms of real time."""

_WATCHED_SLICE_S = 0.05
"""The same while somebody watches: the period of action feedback, as upstream."""

_EXECUTING = 2
"""action_msgs/msg/GoalStatus.STATUS_EXECUTING."""


class State(IntEnum):
    """States of simulation_interfaces/msg/SimulationState that are used here."""

    STOPPED = 0
    PLAYING = 1
    PAUSED = 2
    QUITTING = 3


@dataclass(frozen=True)
class TrialSetup:
    """What the next reset prepares.

    Attributes:
        number: Number of the trial; negative for none.
        controllers: Controllers that must have a goal before the clock runs; with none, any goal starts it.
        config: Configuration with the trial's values.
    """

    number: int
    controllers: tuple[str, ...]
    config: Config


class Simulation:
    """Steps one world as fast as it can while a run goes on.

    Args:
        config: Configuration of the collection.

    Raises:
        ConfigError: If it does not describe a world.
        WorkerError: If the physics engine does not start.
    """

    def __init__(self, config: Config) -> None:
        self.config = config
        self.setup = TrialSetup(_NO_TRIAL, (), config)
        self.state = State.PLAYING
        self.world = World(config)
        self._period_ns = round(10**9 / config.sim.physics_hz)
        self._stride = config.sim.physics_hz // config.record.rate_hz
        self.limbs = {
            name: Limb(name, joints, moving=self.world.moving, period_ns=self._period_ns)
            for name, joints in CONTROLLERS.items()
        }
        self._keeps_states = "controller_state" in config.record.topics
        self.real_time_factor = config.sim.real_time_factor
        self._results: list[tuple[str, GoalResult]] = []
        self._goals: dict[str, GoalOutcome] = {}
        self.reset()

    @property
    def now_ns(self) -> int:
        """Simulated time [ns]."""
        return self.world.stamp_ns

    @property
    def running(self) -> bool:
        """Whether the clock runs."""
        return self._running and self.state == State.PLAYING

    @property
    def entities(self) -> tuple[str, ...]:
        """Names of what is in the world."""
        return ("ball", self.config.robot.name)

    def set_state(self, state: State) -> None:
        """Play, pause, stop or quit; stopping resets everything.

        Raises:
            ConfigError: If there is no start state to go back to; the state is set all the same.
        """
        self.state = state
        if state == State.STOPPED:
            self.reset()

    def reset(self) -> None:
        """Put world, controllers and clock into the start state of the trial that is set up; goals are aborted.

        Raises:
            ConfigError: If there is no such state; the clock stands still until another reset succeeds.
        """
        self._running = False
        setup = self.setup
        start_ns = 0 if setup.number < 0 else setup.config.trial_start_ns(setup.number)
        self.world.reset(setup.config, start_ns=start_ns)
        posture = start_posture(setup.config)
        for limb in self.limbs.values():
            limb.reset(start_ns, posture)
        self._collect_results()
        self._command = np.array([posture[joint] for joint in self.world.moving])
        self._goals = {}
        self._in_trial = setup.number >= 0
        self._published = 0

    def submit(self, controller: str, goal_id: Hashable, goal: TrajectoryGoal) -> str | None:
        """Give a goal to a controller; the run begins when the last awaited one has its goal.

        Returns:
            None if the goal is accepted, else the reason of the refusal.
        """
        refusal = self.limbs[controller].submit(goal_id, goal, self.now_ns)
        self._collect_results()
        if refusal is None:
            self._goals[controller] = GoalOutcome(controller, _EXECUTING, 0, "")
            self._running |= all(name in self._goals for name in self.setup.controllers)
        return refusal

    def cancel(self, controller: str, goal_id: Hashable) -> bool:
        """Cancel a goal.

        Returns:
            Whether it was being executed.
        """
        limb = self.limbs[controller]
        limb.controller.observe(limb.measured(self.world.joint_positions()))
        cancelled = limb.controller.cancel(goal_id)
        self._collect_results()
        return cancelled

    def follow(self, controller: str, trajectory: Trajectory) -> str | None:
        """Let a controller follow a trajectory that is no goal.

        Returns:
            None if it is accepted, else the reason of the refusal.
        """
        refusal = self.limbs[controller].follow(trajectory, self.now_ns)
        self._running |= refusal is None
        return refusal

    def advance(self, *, watched: bool) -> None:
        """Run for a slice of time, or until the run ends; slept through where a real-time factor asks for it.

        Args:
            watched: Whether somebody wants to see it happen: slices are short then.
        """
        began, stamp = time.monotonic(), self.now_ns
        # In slow motion slices are shorter still, so that the node answers while it waits.
        slice_s = _WATCHED_SLICE_S * min(1.0, self.real_time_factor or 1.0)
        if not watched and self.real_time_factor is None:
            slice_s = _SLICE_S
        self.step(max(1, round(slice_s * self.config.sim.physics_hz)))
        if self._in_trial and self.world.end_reason is not None:
            self._running = False
        elif not self._in_trial and not any(limb.moves for limb in self.limbs.values()):
            self._running = self.world.end_reason is None
        if self.real_time_factor:
            due = began + (self.now_ns - stamp) / 1e9 / self.real_time_factor
            time.sleep(max(0.0, due - time.monotonic()))

    def step(self, steps: int) -> None:
        """Take physics steps; fewer if the trial ends."""
        if not self._in_trial:
            self.world.forget_samples()
        left = steps
        while left > 0 and not (self._in_trial and self.world.end_reason is not None):
            left -= self._step_some(left)

    def pop_results(self) -> list[tuple[str, GoalResult]]:
        """Controllers and results of the goals that have ended since the last call, oldest first."""
        results, self._results = self._results, []
        return results

    def fresh_samples(self) -> Samples:
        """Samples recorded since the last call."""
        first, self._published = self._published, self.world.recorded
        return self.world.samples(first)

    def episode(self) -> tuple[EpisodeHeader, Samples, Mapping[str, ControllerSamples]] | None:
        """What the trial yielded, once it has ended; then never again until the next reset."""
        if not self._in_trial or self.world.end_reason is None:
            return None
        self._in_trial = False
        samples = self.world.samples()
        header = EpisodeHeader(
            trial=self.setup.number,
            start_ns=int(samples.stamps_ns[0]),
            end_reason=self.world.end_reason,
            contacts=self.world.contacts(),
            goals=tuple(self._goals[name] for name in self.limbs if name in self._goals),
            samples=len(samples),
        )
        states = {}
        if self._keeps_states:
            self._look(self.limbs.values())
            states = {name: limb.kept_states() for name, limb in self.limbs.items()}
        return header, samples, states

    def controller_state(self, controller: str) -> ControllerState:
        """What a controller has seen and done last."""
        limb = self.limbs[controller]
        limb.controller.observe(limb.measured(self.world.joint_positions()))
        return limb.controller.state()

    def entity_state(self, name: str) -> BallState | None:
        """Where an entity is and how it moves; None if there is none of that name."""
        if name == "ball":
            return self.world.ball
        if name == self.config.robot.name:
            return BallState((0.0, 0.0, self.config.robot.base_height_m))
        return None

    def set_entity_state(self, name: str, state: BallState) -> bool:
        """Put an entity somewhere.

        Returns:
            Whether it can be moved; the robot is fixed.
        """
        if name != "ball":
            return False
        self.world.ball = state
        return True

    def _step_some(self, most: int) -> int:
        """Take at most `most` steps, so that a controller looks at the measured state when it has to."""
        moving = [limb for limb in self.limbs.values() if limb.moves]
        free = most
        if self._keeps_states:
            # Every controller looks at each sample; between samples there is nothing to keep.
            moving = list(self.limbs.values())
            phase = self.world.steps % self._stride
            free = min(free, self._stride - phase) if phase else 0
        for limb in moving:
            free = min(free, limb.controller.next_decision())
        if free > 0:
            commands = np.tile(self._command, (free, 1))
            for limb in moving:
                limb.take(commands)
        else:
            self._look(moving)
            commands = self._command[np.newaxis].copy()
        self._command = commands[-1].copy()
        self.world.run(commands, stop_at_end=self._in_trial)
        self._collect_results()
        return len(commands)

    def _look(self, limbs: Iterable[Limb]) -> None:
        """Let controllers see the measured state, for one control period."""
        positions = self.world.joint_positions()
        keeps = self._keeps_states and self.world.steps % self._stride == 0
        for limb in limbs:
            limb.update(self.now_ns, self._period_ns, positions, self._command)
            if keeps:
                limb.keep_state()

    def _collect_results(self) -> None:
        for name, limb in self.limbs.items():
            for result in limb.pop_results():
                self._results.append((name, result))
                if name in self._goals:
                    self._goals[name] = GoalOutcome(name, result.status, result.error_code, result.error_string)
