"""Whether an episode that arrives is the one that was asked for, and whether it is sound."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Any

from throwcollect.build import build_digest
from throwcollect.config.key import Effect
from throwcollect.config.schema import Config
from throwcollect.config.values import sweepable_keys
from throwcollect.coordinator.goals import goal_message, trial_goals
from throwcollect.dataset.recorded_trial import RecordedTrial
from throwcollect.dataset.verify_episode import find_channel_problems, find_sensor_problems, find_stamp_problems
from throwcollect.dataset.verify_header import find_header_problems
from throwcollect.dataset.verify_motion import find_infinite_columns
from throwcollect.episode.channels import Channels
from throwcollect.episode.message import Delivery, Episode
from throwcollect.errors import DatasetError
from throwcollect.robots.description import full_description, robot_of, start_posture, touchable_bodies
from throwcollect.robots.trajectory import JointTrajectory
from throwcollect.sweep.plan import Plan, Trial
from throwcollect.tasks.task import task_of
from throwcollect.trial.conditions import Conditions, Settings, conditions_from_json
from throwcollect.trial.lease import Lease

_MOST_TOLD = 3
"""Differences that are told of one episode."""


@dataclass(frozen=True)
class PreparedTrial:
    """Everything that is worked out of a trial before it is leased.

    Attributes:
        config: Configuration of the trial.
        trajectory: What the joints are to follow.
        physics: What the trial replaces of the simulation's configuration, by dotted key.
        messages: Goal of each controller that moves, as a message.
        conditions: What the episode has to be simulated with; its lease is not known yet.
    """

    config: Config
    trajectory: JointTrajectory
    physics: Mapping[str, float]
    messages: Mapping[str, Any]
    conditions: Conditions

    def lease(self, simulation: str, trial: int) -> Lease:
        """The lease of the trial for one simulation."""
        return Lease(simulation, trial, tuple(self.messages), self.physics)


class Acceptance:
    """Knows what each trial of a plan has to be simulated with, and checks what simulations hand over.

    Args:
        config: Configuration of the collection.
    """

    def __init__(self, config: Config) -> None:
        self._config = config
        self._settings = Settings(config)
        self._physics = set(sweepable_keys(config, Effect.PHYSICS))
        self._channels = Channels(config, full_description(config))
        self._bodies = touchable_bodies(config)

    def prepare(self, plan: Plan, trial: Trial) -> PreparedTrial:
        """Work out a trial."""
        config = plan.config_of(trial)
        trajectory = task_of(config).trajectory()
        goals = trial_goals(robot_of(config), trajectory, start_posture(config))
        physics = {key: value for key, value in trial.values.items() if key in self._physics}
        conditions = Conditions(
            build=build_digest(self._config.sim.engine),
            settings=self._settings.digest,
            values=self._settings.find_replaced(config),
            inputs={controller: goal.digest for controller, goal in goals.items()},
            lease="",
        )
        messages = {controller: goal_message(goal) for controller, goal in goals.items()}
        return PreparedTrial(config, trajectory, physics, messages, conditions)

    @staticmethod
    def foreign(delivery: Delivery, prepared: PreparedTrial, token: str) -> str | None:
        """Why an episode is not the one that was asked for; None if it is.

        Args:
            delivery: The episode, with what the simulation says of it.
            prepared: Its trial.
            token: Signature of the lease.
        """
        try:
            conditions = conditions_from_json(delivery.conditions)
        except DatasetError as error:
            return error.message
        expected = replace(prepared.conditions, lease=token)
        differences = list(conditions.differences(expected))
        more = f" and {len(differences) - _MOST_TOLD} more" if len(differences) > _MOST_TOLD else ""
        return "; ".join(differences[:_MOST_TOLD]) + more or None

    def unsound(self, episode: Episode, prepared: PreparedTrial) -> str | None:
        """What is wrong with an episode that nobody could want in a dataset; None if nothing is.

        Channels, times, numbers and header are checked here, in about half a millisecond; `dataset verify` also asks
        physics.

        Args:
            episode: The episode.
            prepared: Its trial.
        """
        try:
            return next(self._problems(episode, prepared), None)
        except DatasetError as error:
            return str(error)

    def _problems(self, episode: Episode, prepared: PreparedTrial) -> Iterator[str]:
        samples = episode.samples(robot_of(self._config).joints)
        yield from find_channel_problems(episode, self._channels)
        yield from find_stamp_problems(episode, samples, prepared.config)
        yield from find_sensor_problems(episode)
        yield from find_infinite_columns(samples)
        trial = RecordedTrial(samples, episode.header, prepared.config, prepared.trajectory)
        yield from find_header_problems(trial, self._bodies)
