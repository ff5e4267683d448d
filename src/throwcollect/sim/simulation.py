"""One simulation without its ROS interface: the world, the limbs' controllers, the clock, and the present run.

A *run* begins when goals have been accepted and ends with the trial, or, when no trial was set up, when limbs and
ball are at rest again. The clock stands still outside of runs, so that no step is wasted.
"""

from __future__ import annotations

import time
from collections.abc import Hashable, Iterable, Mapping
from dataclasses import dataclass
from enum import IntEnum, IntFlag

import numpy as np

from throwcollect.config.schema import Config
from throwcollect.control import GoalResult, JointTrajectoryController, Trajectory, TrajectoryGoal, TrajectoryRefusal
from throwcollect.episode.record import ControllerSamples, EpisodeHeader, Samples
from throwcollect.errors import RequestError, ThrowcollectError
from throwcollect.robots.description import robot_of, start_posture
from throwcollect.sim.limb_controller import LimbController
from throwcollect.sim.pace import STRETCH_S, WATCHED_STRETCH_S, Pace, long_stretch_steps, longest_steps, stretch_steps
from throwcollect.sim.present_trial import PresentTrial, TrialSetup
from throwcollect.sim.world import World
from throwcollect.units import NS_PER_S


class StateCode(IntEnum):
    """States of simulation_interfaces/msg/SimulationState that are used here."""

    STOPPED = 0
    PLAYING = 1
    PAUSED = 2
    QUITTING = 3


class Scope(IntFlag):
    """Parts that a reset resets, by the constants of simulation_interfaces/srv/ResetSimulation."""

    TIME = 1
    STATE = 2
    ALL = TIME | STATE


@dataclass
class StepRequest:
    """Physics steps that a client wants while the clock stands still, and how far they have come.

    Attributes:
        wanted: Number of steps that the client wants.
        taken: Number of steps that have been taken so far.
        interruption: Why no more steps will be taken; None if nothing has interrupted them.
    """

    wanted: int
    taken: int = 0
    interruption: str | None = None

    @property
    def is_over(self) -> bool:
        """Whether no more steps will be taken."""
        return self.interruption is not None or self.taken >= self.wanted


class Simulation:
    """Steps one world as fast as it can while a run goes on.

    Raises:
        ConfigError: If the configuration does not describe a world.
        WorkerError: If the physics engine does not start.
    """

    def __init__(self, config: Config) -> None:
        self.config = config
        self.trial = PresentTrial(config)
        self.state = StateCode.PLAYING
        self.world = World(config)
        self._steps: StepRequest | None = None
        self._period_ns = period_ns = round(NS_PER_S / config.sim.physics_hz)
        self._stride = config.sim.physics_hz // config.record.rate_hz
        robot = robot_of(config)
        self.limbs = {
            name: LimbController(robot, name, moving=self.world.moving, period_ns=period_ns, config=config.controllers)
            for name in robot.controllers
        }
        self._watched: list[LimbController] = []
        self._keeps_states = "controller_state" in config.record.topics
        self._pace = Pace()
        self.real_time_factor = config.sim.real_time_factor
        self._results: list[tuple[str, GoalResult]] = []
        self._driven_until_ns = 0
        """Time at which a client last moved a limb [ns], or gave it something to do."""
        self._has_start = False
        """Whether the world has a start state to go on from, which it lacks after a reset of its state has failed."""
        self.reset()

    @property
    def now_ns(self) -> int:
        """Simulated time [ns]."""
        return self.world.stamp_ns

    @property
    def running(self) -> bool:
        """Whether there is something to `advance`: the clock runs, or steps are left to be taken."""
        return self._steps is not None or (self._running and self._has_start and self.state == StateCode.PLAYING)

    def lease(self, number: int, config: Config, goals: Mapping[str, TrajectoryGoal]) -> None:
        """Begin a trial for a coordinator, which no other client may touch, with controllers as they are configured.

        The configuration has the values of the trial; there is a goal for each controller that moves.
        """
        # Controllers refuse goals during a lease, so this trial counts as leased only when they have their goals.
        self.trial.leased = False
        for limb in self.limbs.values():
            limb.restore()
        self.trial.setup = TrialSetup(number, tuple(goals), config)
        self.reset()
        for controller, goal in goals.items():
            # The id of a client's goal is a number. This id is none, so that no client gets the result of this goal.
            if (refusal := self.submit(controller, ("trial", number), goal)) is not None:
                raise ThrowcollectError(f"trial {number}: {controller} refuses its goal: {refusal}")
        self.trial.leased = True

    def end_lease(self) -> None:
        """Forget a leased trial that the coordinator has taken back, and go back to the configuration."""
        self.trial.set_up_nothing()
        self.reset()

    def set_state(self, state: StateCode) -> None:
        """Play, pause, stop or quit; stopping resets everything."""
        if state == StateCode.STOPPED:
            self.trial.require_free()
        self.state = state
        self._interrupt_steps(f"the simulation is {state.name} now")
        if state == StateCode.STOPPED:
            self.reset()

    def reset(self, scope: Scope = Scope.ALL) -> None:
        """Go back to the start, in whole or in part.

        Args:
            scope: ``STATE`` puts world and controllers into the start state of the trial that is set up. ``TIME`` puts
                the clock to the trial's start. Either aborts all goals; only both together begin a trial.
        """
        of_time, of_state = Scope.TIME in scope, Scope.STATE in scope
        self._interrupt_steps("the simulation was reset")
        self._running = self._in_trial = False
        self.trial.begin()
        setup = self.trial.setup
        start_ns = self.now_ns
        if of_time:
            # Each trial has a slot of time of its own, so that stamps in a dataset never overlap.
            start_ns = 0 if setup.number < 0 else setup.config.trial_start_ns(setup.number)
        if of_state:
            self._has_start = False
            self.world.reset(setup.config, start_ns=start_ns)
            posture = start_posture(setup.config)
            self._has_start = True
        else:
            self.world.restart_clock(start_ns)
            posture = self.world.posture()
        for limb in self.limbs.values():
            limb.reset(start_ns, posture, speed=setup.config.robot.speed_scale)
        self._collect_results()
        self._command = np.array([posture[joint] for joint in self.world.moving])
        # After a reset of time or state alone, what follows is not the trial that the plan has drawn.
        self._in_trial = setup.number >= 0 and of_time and of_state
        self._published = 0

    def submit(self, controller: str, goal_id: Hashable, goal: TrajectoryGoal) -> TrajectoryRefusal | None:
        """Give a goal to a controller, or refuse it; a run begins once all controllers that need a goal have one."""
        if (leased := self.trial.refusal) is not None:
            return leased
        limb = self.limbs[controller]
        refusal = limb.refuse_locked(goal.trajectory) or limb.controller.submit(goal_id, goal, self.now_ns)
        self._collect_results()
        if refusal is None:
            self.trial.note_goal(controller)
            self._begin_motion()
        return refusal

    def cancel(self, controller: str, goal_id: Hashable) -> bool:
        """Cancel a goal; return False if it was not being executed, or the simulation is leased."""
        if self.trial.leased:
            return False
        cancelled = self.observe(controller).cancel(goal_id)
        self._collect_results()
        return cancelled

    def follow(self, controller: str, trajectory: Trajectory) -> TrajectoryRefusal | None:
        """Let a controller follow a trajectory that is no goal, or refuse it; a run begins unless a goal is missing."""
        if (leased := self.trial.refusal) is not None:
            return leased
        limb = self.limbs[controller]
        refusal = limb.refuse_locked(trajectory) or limb.controller.replace(trajectory, self.now_ns)
        self._collect_results()
        if refusal is None:
            self._begin_motion()
        return refusal

    def advance(self, *, watched: bool) -> None:
        """Run for a stretch of time, or until the run ends; with a real-time factor, take as much time as it says.

        The stretch has to be short if a client listens (`watched`).
        """
        began_s, since_ns, factor = time.monotonic(), self.now_ns, self.real_time_factor
        # Long stretches cost the least. Short ones let messages be sent in between, which only watching clients need.
        stretch_s = STRETCH_S if (self._in_trial or self._steps) and not (watched or factor) else WATCHED_STRETCH_S
        steps = max(1, round(stretch_s * self.config.sim.physics_hz))
        if (request := self._steps) is not None:
            request.taken += self.step(min(steps, request.wanted - request.taken))
            if request.is_over:
                self._steps = None
            return
        if factor and self.trial.leased and not watched:
            # Every stretch costs time besides physics, so stretches are as long as requests can wait.
            steps = long_stretch_steps(factor, self.config.sim.physics_hz, STRETCH_S)
        elif factor:
            steps = stretch_steps(factor, self.config.sim.physics_hz, self._stride, self.world.steps % self._stride)
        self.step(steps)
        # A trial ends when its rules say so; a motion by hand, when limbs and ball rest, or it rolls for too long.
        if self._in_trial:
            self._running = self.world.end_reason is None
        elif any(limb.is_driven for limb in self.limbs.values()):
            self._driven_until_ns = self.now_ns
        elif self.world.rests or self.now_ns - self._driven_until_ns >= self.config.sim.max_trial_s * NS_PER_S:
            self._running = False
        if factor:
            self._pace.wait(factor, began_s=began_s, since_ns=since_ns, until_ns=self.now_ns)

    @property
    def feedback_ns(self) -> int:
        """Simulated time between two messages of feedback [ns]; 0 to send feedback after every stretch."""
        if not self.real_time_factor or self.state != StateCode.PLAYING:
            return 0
        return longest_steps(self.real_time_factor, self.config.sim.physics_hz) * self._period_ns

    def request_steps(self, steps: int) -> StepRequest:
        """Have `advance` take physics steps while the clock stands still; trials may end on the way.

        The request that is returned is kept up to date.
        """
        if self.state != StateCode.PAUSED:
            message = f"steps are taken while the simulation is paused only; it is {self.state.name}"
            raise RequestError("RESULT_OPERATION_FAILED", message)
        if not self._has_start:
            raise RequestError("RESULT_INCORRECT_STATE", "there is no start state until a reset succeeds")
        if self._steps is not None:
            message = f"{self._steps.taken} of {self._steps.wanted} steps of another request have been taken"
            raise RequestError("RESULT_INCORRECT_STATE", message, hint="wait for its end")
        request = StepRequest(steps)
        if not request.is_over:
            self._steps = request
        return request

    def cancel_steps(self, request: StepRequest) -> None:
        """Take no more steps of a request."""
        if request is self._steps:
            self._interrupt_steps("cancelled")

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

    def pop_results(self) -> list[tuple[str, GoalResult]]:
        """Return controllers and results of the goals that have ended since the last call, oldest first."""
        results, self._results = self._results, []
        return results

    def fresh_samples(self) -> Samples:
        """Return the samples that were recorded since the last call."""
        first, self._published = self._published, self.world.recorded
        return self.world.samples(first)

    def last_sample(self) -> Samples:
        """Return the sample that was recorded last."""
        return self.world.samples(self.world.recorded - 1)

    def episode(self) -> tuple[EpisodeHeader, Samples, Mapping[str, ControllerSamples]] | None:
        """Return the recording of a trial that has ended, only once; None while there is no such recording."""
        if not self._in_trial or self.world.end_reason is None:
            return None
        self._in_trial = self.trial.leased = False
        samples = self.world.samples()
        header = EpisodeHeader(
            trial=self.trial.begun.number,
            start_ns=int(samples.stamps_ns[0]),
            end_reason=self.world.end_reason,
            contacts=self.world.contacts(),
            goals=self.trial.outcomes(self.limbs),
            samples=len(samples),
        )
        states = {}
        if self._keeps_states:
            # The last sample was recorded after controllers looked at the measured state for the last time.
            self._look(self.limbs.values())
            self._collect_results()
            states = {name: limb.collect_states() for name, limb in self.limbs.items()}
        return header, samples, states

    def observe(self, controller: str) -> JointTrajectoryController:
        """Return a controller after it has seen the present state of its joints, which its `state` and `query` need."""
        limb = self.limbs[controller]
        limb.controller.observe(limb.measure(*self.world.joints()))
        return limb.controller

    def watch(self, controllers: Iterable[str]) -> None:
        """Keep the states of these controllers, and of no others, for `LimbController.pop_states`."""
        self._watched = [self.limbs[name] for name in controllers]
        for limb in self.limbs.values():
            limb.watched = limb in self._watched
            if not limb.watched:
                # A client that watches this limb later must not get states from before that.
                limb.pop_states()

    def _begin_motion(self) -> None:
        self._driven_until_ns = self.now_ns
        self._running |= self.trial.has_all_goals

    def _interrupt_steps(self, reason: str) -> None:
        if self._steps is not None:
            self._steps.interruption = reason
            self._steps = None

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
        if free > 0:
            commands = np.tile(self._command, (free, 1))
            for limb in moving:
                limb.take(commands)
        else:
            self._look(moving)
            commands = self._command[np.newaxis].copy()
        self._command = commands[-1].copy()
        taken = self.world.run(commands, stop_at_end=self._in_trial)
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
            for result in limb.pop_results():
                self._results.append((name, result))
                self.trial.note_result(name, result)
