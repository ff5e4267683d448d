"""Compares episodes that arrive with what the coordinator has asked for."""

from __future__ import annotations

from throwcollect.config.schema import Config
from throwcollect.errors import DatasetError
from throwcollect.sweep.plan import Plan
from throwcollect.sweep.trials import Trial
from throwcollect.tasks.task import trajectory_of
from throwcollect.trial.conditions import Conditions, Settings, build_of, conditions_from_json

_MOST_TOLD = 3
"""Largest number of differences that the reason for refusing one episode names."""


class Acceptance:
    """Works out the conditions that each trial of a plan has to be simulated under."""

    def __init__(self, config: Config) -> None:
        self._build = build_of(config)
        self._settings = Settings(config)

    def find_difference(self, text: str, plan: Plan, trial: Trial) -> str | None:
        """Say why an episode is not the one that a trial of a plan asks for; None if it is.

        `text` has the conditions that the simulation reports, in JSON.
        """
        try:
            conditions = conditions_from_json(text)
        except DatasetError as error:
            return error.message
        config = plan.config_of(trial)
        expected = Conditions(
            build=self._build,
            settings=self._settings.digest,
            values=self._settings.find_replaced(config),
            trajectory=trajectory_of(config).digest,
        )
        differences = list(conditions.differences(expected))
        more = f" and {len(differences) - _MOST_TOLD} more" if len(differences) > _MOST_TOLD else ""
        return "; ".join(differences[:_MOST_TOLD]) + more or None
