"""The trial that a simulation is set up for: its lease, and the goals of its controllers with their results."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

from throwcollect.config.schema import Config
from throwcollect.control import ErrorCode, GoalResult, GoalStatus, TrajectoryRefusal
from throwcollect.episode.record import GoalOutcome
from throwcollect.errors import RequestError
from throwcollect.robots.trajectory import JointTrajectory

NO_TRIAL = -1
"""Number of the trial while none is set up."""


@dataclass(frozen=True)
class TrialSetup:
    """The trial that the next reset prepares.

    Attributes:
        number: Number of the trial; negative for none.
        controllers: Controllers that must have a goal before the clock runs; with none, any goal starts it.
        config: Configuration with the trial's values.
    """

    number: int
    controllers: tuple[str, ...]
    config: Config


class PresentTrial:
    """The trial of a simulation, without the physics.

    Attributes:
        setup: The trial that the next reset prepares.
        begun: The trial that the last reset has prepared.
        motion: Motion of a trial that `Simulator.begin` has begun, until its episode is handed over; None for a trial
            that a client has set up.
    """

    def __init__(self, config: Config) -> None:
        self.setup = self.begun = TrialSetup(NO_TRIAL, (), config)
        self.motion: JointTrajectory | None = None
        self._config = config
        self._goals: dict[str, GoalOutcome] = {}

    def set_up_nothing(self) -> None:
        """End the lease, and let the next reset go back to the configuration."""
        self.motion = None
        self.setup = TrialSetup(NO_TRIAL, (), self._config)

    def begin(self) -> None:
        """Begin the trial that is set up, and forget the goals of the previous trial."""
        self.begun = self.setup
        self._goals = {}

    @property
    def leased(self) -> bool:
        """Whether the trial belongs to a coordinator; meanwhile, no other client may change anything."""
        return self.motion is not None

    @property
    def has_all_goals(self) -> bool:
        """Whether every controller that must have a goal before the clock runs has had one."""
        return all(name in self._goals for name in self.begun.controllers)

    def require_free(self) -> None:
        """Refuse a request that would change a leased trial."""
        if self.leased:
            raise RequestError("RESULT_INCORRECT_STATE", self.lease_in_words)

    @property
    def lease_in_words(self) -> str:
        """Sentence by which requests are refused while the simulation is leased."""
        return f"the simulation is leased for trial {self.setup.number}, until its episode is handed over"

    @property
    def refusal(self) -> TrajectoryRefusal | None:
        """Refusal of goals and trajectories while the simulation is leased; otherwise None."""
        return TrajectoryRefusal(ErrorCode.INVALID_GOAL, self.lease_in_words) if self.leased else None

    def note_goal(self, controller: str) -> None:
        """Note that a controller has accepted a goal."""
        self._goals[controller] = GoalOutcome(controller, GoalStatus.EXECUTING, 0, "")

    def note_result(self, controller: str, result: GoalResult) -> None:
        """Note that the goal of a controller has ended."""
        if controller in self._goals:
            outcome = GoalOutcome(controller, result.status, result.error_code, result.error_string)
            self._goals[controller] = outcome

    def outcomes(self, controllers: Iterable[str]) -> tuple[GoalOutcome, ...]:
        """Return the outcomes of the goals of these controllers, in their order."""
        return tuple(self._goals[name] for name in controllers if name in self._goals)
