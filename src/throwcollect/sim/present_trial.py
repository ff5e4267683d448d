"""The trial that a simulation is set up for: for whom, what has reached its controllers, and what became of that."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

from throwcollect.build import build_digest
from throwcollect.config.schema import Config
from throwcollect.control import ErrorCode, GoalResult, Refusal, TrajectoryGoal
from throwcollect.episode.record import GoalOutcome
from throwcollect.errors import RequestError
from throwcollect.trial.conditions import Conditions, Settings

_NO_TRIAL = -1
_EXECUTING = 2
"""action_msgs/msg/GoalStatus.STATUS_EXECUTING."""
_NO_GOAL = "no goal of an action"
"""In the place of a goal's digest where something else moved or stopped a controller."""


@dataclass(frozen=True)
class TrialSetup:
    """What the next reset prepares.

    Attributes:
        number: Number of the trial; negative for none.
        controllers: Controllers that must have a goal before the clock runs; with none, any goal starts it.
        config: Configuration with the trial's values.
        lease: Token of the lease that asks for it; empty if none does.
    """

    number: int
    controllers: tuple[str, ...]
    config: Config
    lease: str = ""


class PresentTrial:
    """What a simulation knows of its trial besides the physics.

    Attributes:
        setup: What the next reset prepares.
        leased: Whether the trial belongs to a coordinator, until its episode is handed over; meanwhile nobody else may
            change anything.

    Args:
        config: Configuration of the collection.
    """

    def __init__(self, config: Config) -> None:
        self.setup = TrialSetup(_NO_TRIAL, (), config)
        self.leased = False
        self._config = config
        self._settings = Settings(config)
        self._used = config
        self._goals: dict[str, GoalOutcome] = {}
        self._inputs: dict[str, str] = {}

    def set_up_nothing(self) -> None:
        """Take the trial from its coordinator, who will not accept the episode any more; all is as configured."""
        self.leased = False
        self.setup = TrialSetup(_NO_TRIAL, (), self._config)

    def begin(self, used: Config | None) -> None:
        """Forget what has reached the controllers.

        Args:
            used: Configuration that the world is put into the start state of; None if the world stays as it is.
        """
        self._used = used or self._used
        self._goals, self._inputs = {}, {}

    @property
    def has_all_goals(self) -> bool:
        """Whether every controller that must have a goal before the clock runs has had one."""
        return all(name in self._goals for name in self.setup.controllers)

    def require_free(self) -> None:
        """Refuse what would change a leased trial.

        Raises:
            RequestError: ``RESULT_INCORRECT_STATE`` while the simulation is leased.
        """
        if self.leased:
            raise RequestError("RESULT_INCORRECT_STATE", self.lease_in_words)

    @property
    def lease_in_words(self) -> str:
        """Why something is refused while the simulation is leased."""
        return f"the simulation is leased for trial {self.setup.number}, until its episode is handed over"

    def refusal(self, controller: str, *, goal: bool) -> Refusal | None:
        """Why something may not reach a controller: a leased trial takes one goal for each awaited controller.

        Args:
            controller: Its name in the simulation.
            goal: Whether it is the goal of an action.
        """
        if not self.leased or (goal and controller in self.setup.controllers and controller not in self._goals):
            return None
        return Refusal(ErrorCode.INVALID_GOAL, self.lease_in_words)

    def note_goal(self, controller: str, goal: TrajectoryGoal) -> None:
        """A controller has accepted a goal."""
        self._inputs[controller] = goal.digest if controller not in self._inputs else _NO_GOAL
        self._goals[controller] = GoalOutcome(controller, _EXECUTING, 0, "")

    def note_other_input(self, controller: str) -> None:
        """Something that is no goal has moved or stopped a controller."""
        self._inputs[controller] = _NO_GOAL

    def note_result(self, controller: str, result: GoalResult) -> None:
        """The goal of a controller has ended."""
        if controller in self._goals:
            outcome = GoalOutcome(controller, result.status, result.error_code, result.error_string)
            self._goals[controller] = outcome

    def outcomes(self, controllers: Iterable[str]) -> tuple[GoalOutcome, ...]:
        """What became of the goals of these controllers, in their order."""
        return tuple(self._goals[name] for name in controllers if name in self._goals)

    def conditions(self) -> Conditions:
        """What the trial is, or was, simulated with."""
        values = self._settings.find_replaced(self._used)
        build = build_digest(self._config.sim.engine)
        return Conditions(build, self._settings.digest, values, dict(self._inputs), self.setup.lease)
