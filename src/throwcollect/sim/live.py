"""A simulator as the clients of its node drive it, without messages."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Collection, Hashable, Iterable, Sequence
from dataclasses import dataclass, replace
from enum import IntEnum

import numpy as np

from throwcollect.config.schema import Config
from throwcollect.control.controller import JointTrajectoryController
from throwcollect.control.values import Trajectory, TrajectoryGoal, TrajectoryRefusal
from throwcollect.engines.engine import BodyState, SceneBody
from throwcollect.episode.record import EpisodeHeader, Samples
from throwcollect.errors import RequestError
from throwcollect.plan.trials import NO_TARGET, Values
from throwcollect.sim import pace
from throwcollect.sim.simulator import STRETCH_S, Simulator
from throwcollect.units import NS_PER_S


class StateCode(IntEnum):
    """States of simulation_interfaces/msg/SimulationState that are used here."""

    STOPPED = 0
    PLAYING = 1
    PAUSED = 2
    QUITTING = 3


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


class LiveSimulator(Simulator):
    """A simulator that clients drive, too: it plays, pauses, steps and keeps pace with real time.

    Outside of trials, the clock runs while a limb or the object moves, and stands still otherwise.

    Attributes:
        state: Whether the clock may run.
        real_time_factor: Simulated over real time [-]; None for no limit.
        shows_trial: Whether the world holds the samples of a leased trial, which may have ended; a reset drops them.
    """

    def __init__(self, config: Config, on_frame: Callable[[], None] = lambda: None) -> None:
        self.state = StateCode.PLAYING
        self.real_time_factor = config.sim.real_time_factor
        self._pace = pace.Pace()
        self._steps: StepRequest | None = None
        self._spawned: dict[str, SceneBody] = {}
        self._driven_until_ns = 0
        """Time at which a client last moved a limb [ns], or gave it something to do."""
        self._has_start = False
        """Whether the world has a start state to go on from, which it lacks after a reset of its state has failed."""
        super().__init__(config, on_frame=on_frame)

    @property
    def running(self) -> bool:
        """Whether there is something to `advance`: the clock runs, or steps are left to be taken."""
        return self._steps is not None or (self._running and self._has_start and self.state == StateCode.PLAYING)

    def set_state(self, state: StateCode) -> None:
        """Play, pause, stop or quit; stopping resets everything."""
        if state == StateCode.STOPPED:
            self.trial.require_free()
        self.state = state
        self._interrupt_steps(f"the simulation is {state.name} now")
        if state == StateCode.STOPPED:
            self.reset()

    def begin(self, number: int, values: Values, *, seed: int = 0, target: Values = NO_TARGET) -> None:
        """Begin a trial; see `Simulator.begin`."""
        super().begin(number, values, seed=seed, target=target)
        self.shows_trial = True
        self._begin_motion()

    def reset(self, *, time: bool = True, state: bool = True) -> None:
        """Go back to the start, in whole or in part; see `Simulator.reset`."""
        self._interrupt_steps("the simulation was reset")
        self._running = self.shows_trial = False
        self._published = 0
        self._has_start &= not state
        super().reset(time=time, state=state)
        self._has_start |= state
        if state:
            self._spawned = {}

    @property
    def spawned(self) -> Sequence[str]:
        """Names of the bodies that clients have spawned; the next reset of the state removes them."""
        return tuple(self._spawned)

    def spawn(self, body: SceneBody) -> None:
        """Put a body into the world, under a name that nothing else has."""
        self._change_spawned({**self._spawned, body.link.name: body})

    def remove_spawned(self, names: Collection[str]) -> None:
        """Take bodies that were spawned out of the world."""
        self._change_spawned({name: body for name, body in self._spawned.items() if name not in names})

    def _change_spawned(self, spawned: dict[str, SceneBody]) -> None:
        self.trial.require_free()
        if not self._has_start:
            raise RequestError("RESULT_INCORRECT_STATE", "there is no start state until a reset succeeds")
        self.world.set_spawned(spawned.values())
        # What follows is not the trial that a client has set up.
        self._spawned, self._in_trial, self._sent, self._published = spawned, False, None, 0

    def place(self, name: str, state: BodyState) -> None:
        """Set pose and velocity of a body that moves."""
        self.trial.require_free()
        if self.records and self.world.steps:
            raise RequestError(
                "RESULT_INCORRECT_STATE", "a recording runs, and bodies are placed before its first step"
            )
        self.world.place(name, state)

    @property
    def records(self) -> bool:
        """Whether what clients do is recorded; every reset ends that."""
        return self._sent is not None

    def begin_recording(self) -> None:
        """Reset everything, and record what clients do until they or the task end it, or `sim.max_trial_s` is over."""
        self.trial.require_free()
        if self.records:
            raise RequestError("RESULT_INCORRECT_STATE", "a recording runs already")
        if self.trial.config != self.config:
            message = "parameters set up other physics than the file; a recording has those of the file"
            raise RequestError("RESULT_INCORRECT_STATE", message)
        self.reset()
        self.world.may_rest, self._in_trial, self._sent = True, True, []

    @property
    def recording_ended(self) -> bool:
        """Whether a recording is over, and waits for `end_recording`."""
        return self.records and self.world.end_reason is not None

    def end_recording(self) -> tuple[EpisodeHeader, Samples] | None:
        """End the recording that runs, return it, and reset everything; None if nothing has moved since it began."""
        sent, columns = self._sent or [], [self.world.moving.index(joint) for joint in self.config.moving_joints]
        self.world.end_reason = self.world.end_reason or ("rest" if self.world.rests else "timeout")
        recorded = self.take_recording()
        # Behind the last sample, the last command holds.
        command = np.vstack([*sent, self._command])[:, columns]
        self.reset()
        if recorded is None or len(recorded[1]) == 1:
            return None
        return recorded[0], replace(recorded[1], command=np.stack([command, command], axis=1))

    def submit(self, controller: str, goal_id: Hashable, goal: TrajectoryGoal) -> TrajectoryRefusal | None:
        """Give a goal to a controller, or refuse it; the clock runs from then on."""
        if (leased := self.trial.refusal) is not None:
            return leased
        if (refusal := self.give(controller, goal_id, goal)) is None:
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
        """Let a controller follow a trajectory that is no goal, or refuse it; the clock runs from then on."""
        if (leased := self.trial.refusal) is not None:
            return leased
        limb = self.limbs[controller]
        refusal = limb.refuse_locked(trajectory) or limb.controller.replace(trajectory, self.now_ns)
        self._collect_results()
        if refusal is None:
            self._begin_motion()
        return refusal

    def advance(self, *, watched: bool) -> None:
        """Run for a stretch of time, or until the run ends; with a real-time factor, take as much time as it asks for.

        The stretch has to be short if a client listens (`watched`).
        """
        began_s, since_ns, factor = time.monotonic(), self.now_ns, self.real_time_factor
        hz = self.config.sim.physics_hz
        if not watched and (self.trial.leased or self._steps):
            # Long stretches cost the least; in real time, they are as long as requests can wait.
            steps = max(1, round(min(pace.STRETCH_S * (factor or math.inf), STRETCH_S) * hz))
        elif factor:
            steps = pace.count_steps(factor, hz, self._stride, self.world.steps % self._stride)
        else:
            steps = round(pace.STRETCH_S * hz)
        if (request := self._steps) is not None:
            request.taken += self.step(min(steps, request.wanted - request.taken))
            if request.is_over:
                self._steps = None
            return
        self.step(steps)
        # A trial ends when its rules say so; a motion by hand, when limbs and object rest, or it rolls for too long.
        if self._in_trial and not (self.records and self.world.end_reason is None):
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
        return round(pace.STRETCH_S * min(1.0, self.real_time_factor) * NS_PER_S)

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

    def fresh_samples(self) -> Samples:
        """Return the samples that were recorded since the last call."""
        first, self._published = self._published, self.world.recorded
        return self.world.samples(first)

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
        self._running = True

    def _interrupt_steps(self, reason: str) -> None:
        if self._steps is not None:
            self._steps.interruption = reason
            self._steps = None
