"""Runs trials of a collection in one simulation: begins them, and makes their episodes for the coordinator."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from dataclasses import dataclass

from throwcollect.build import build_digest
from throwcollect.config.schema import Config
from throwcollect.config.values import with_values
from throwcollect.episode.channels import Channels
from throwcollect.episode.chunk_encoder import ChunkEncoder
from throwcollect.episode.episode_message import Delivery, Episode
from throwcollect.episode.record import EpisodeHeader, Samples, find_infinite_columns
from throwcollect.episode.recorded_chunk import RecordedChunk
from throwcollect.errors import ThrowcollectError
from throwcollect.members import explain_failure
from throwcollect.robots.description import full_description, robot_of, start_posture
from throwcollect.robots.trajectory import JointTrajectory
from throwcollect.sim.simulation import Simulation
from throwcollect.tasks.task import task_of, trajectory_of
from throwcollect.trial.conditions import Conditions, Settings
from throwcollect.trial.goals import trial_goals


@dataclass(frozen=True)
class _Begun:
    """A trial that was begun for a coordinator."""

    trajectory: JointTrajectory
    token: str


class TrialRunner:
    """Begins trials and hands over their episodes; the caller advances the simulation in between.

    Attributes:
        channels: The topics that are recorded of a trial.
    """

    def __init__(self, simulation: Simulation) -> None:
        self._simulation = simulation
        config = simulation.config
        self._settings = Settings(config)
        self.channels = Channels(config, full_description(config))
        self._encoder = ChunkEncoder(self.channels, level=config.record.zstd_level)
        self._columns = task_of(config).columns
        self._begun: _Begun | None = None

    def begin(self, trial: int, values: Mapping[str, float], *, token: str = "") -> None:
        """Begin a trial; its controllers get the goals that its configuration makes.

        The values replace those of the configuration, by dotted key; the token is that of its lease, if it has one.

        Raises:
            ConfigError: If the values make no motion, or no start state.
            ThrowcollectError: If a controller refuses its goal.
        """
        # A trial that cannot begin must leave nothing behind that the next episode could be judged by.
        self._begun = None
        config = with_values(self._simulation.config, values)
        trajectory = trajectory_of(config)
        self._simulation.lease(trial, config, trial_goals(robot_of(config), trajectory, start_posture(config)))
        self._begun = _Begun(trajectory, token)

    def release_lease(self) -> None:
        """Take its lease from the trial that runs: its episode is not judged, and names no lease."""
        self._begun = None

    def drop(self) -> None:
        """Break off the trial that runs, and go back to the configuration."""
        self.release_lease()
        self._simulation.end_lease()

    def hand_over(self) -> Delivery | None:
        """The episode of a trial that has ended, given out once, and judged if `begin` began it; None if there is none.

        Raises:
            ThrowcollectError: If it has numbers that are not finite, which no dataset may have.
            MemberError: If its task is of another package and fails.
        """
        ended = self._simulation.episode()
        if ended is None:
            return None
        header, samples, states = ended
        begun, self._begun = self._begun, None
        trial = self._simulation.trial
        config = trial.begun.config
        if begun is not None:
            # What clients set up by hand later begins with the configuration, and not with the values of this trial.
            trial.set_up_nothing()
        conditions = Conditions(
            build=build_digest(config.sim.engine),
            settings=self._settings.digest,
            values=self._settings.find_replaced(config),
            trajectory=begun.trajectory.digest if begun else "",
            lease=begun.token if begun else "",
        )
        table = self._encoder.lay_out(samples, states)
        # The records are judged, as by every reader of the dataset: they hold velocities in the ball's frame.
        result = self._judge(config, begun.trajectory, table.samples, header) if begun else ""
        state = RecordedChunk(self._encoder.compress(table), hashlib.sha256(table.contents).hexdigest())
        episode = Episode(header, state)
        return Delivery(episode, result, conditions.to_json())

    def _judge(self, config: Config, trajectory: JointTrajectory, samples: Samples, header: EpisodeHeader) -> str:
        """The result of a trial in JSON.

        Raises:
            ThrowcollectError: If its samples hold numbers that are not finite.
            MemberError: If its task is of another package and fails.
        """
        if (infinite := next(find_infinite_columns(samples), None)) is not None:
            raise ThrowcollectError(f"trial {header.trial}: {infinite}")
        # A result of a wrong kind is a fault of the task as well; it is found where the result is written.
        with explain_failure("tasks", config.task.name, f"judge trial {header.trial}"):
            return self._columns.to_json(task_of(config).judge(samples, header, trajectory))
