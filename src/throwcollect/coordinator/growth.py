"""Makes the further rounds of a plan that grows, piece by piece, while its trials are run."""

from __future__ import annotations

from throwcollect.config.values import with_values
from throwcollect.coordinator.prepare import feasibility_check
from throwcollect.sweep.plan import Check, Plan, make_trials, refusal
from throwcollect.sweep.rounds import Rounds
from throwcollect.sweep.trials import Trials
from throwcollect.tasks.result import Result


class Growth:
    """The trials that a plan will still get.

    Args:
        plan: The plan as it is by now.

    Raises:
        ConfigError: If the sweep cannot be drawn.
    """

    def __init__(self, plan: Plan) -> None:
        self._config = plan.config
        self._rounds = Rounds(plan.config)
        self._rounds.add(plan.trials)
        self._check: Check | None = None
        self._coming: Trials | None = None
        self._reasons: list[str | None] = []

    @property
    def over(self) -> bool:
        """Whether no trial will follow."""
        return self._coming is None and self._rounds.over

    @property
    def most(self) -> int:
        """Number of trials that may follow at most."""
        return 0 if self.over else self._rounds.limit - self._rounds.planned

    def tell(self, trial: int, result: Result) -> None:
        """Take in the result of a trial."""
        self._rounds.tell(trial, result)

    def step(self) -> Trials | tuple[()] | None:
        """Do the next piece of work, of some milliseconds: draw a round, or check one of its trials.

        Returns:
            The trials of a round when it is ready, none before that; None if there is nothing to do.
        """
        if self._coming is None:
            if self._rounds.over or not self._rounds.due:
                return None
            points = self._rounds.draw()
            if points is not None:
                self._coming = make_trials(self._config, points, first=self._rounds.planned)
            return ()
        if len(self._reasons) < len(self._coming):
            self._check = self._check or feasibility_check(self._config)
            trial = self._coming[len(self._reasons)]
            self._reasons.append(refusal(with_values(self._config, trial.values), self._check))
            return ()
        trials = self._coming.refuse(self._reasons)
        self._coming, self._reasons = None, []
        self._rounds.add(trials)
        return trials
