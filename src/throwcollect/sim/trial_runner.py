"""Runs trials of a collection in one simulation: begins them, and makes their episodes for the coordinator."""

from __future__ import annotations

from collections.abc import Mapping

from throwcollect.config.schema import Config
from throwcollect.config.values import with_values
from throwcollect.episode.channels import Channels
from throwcollect.episode.chunk_encoder import ChunkEncoder
from throwcollect.episode.episode_message import Delivery, Episode
from throwcollect.episode.record import EpisodeHeader, Samples, find_infinite_columns
from throwcollect.errors import MemberError, ThrowcollectError
from throwcollect.members import explain_failure
from throwcollect.robots.description import full_description, robot_of, start_posture
from throwcollect.robots.trajectory import JointTrajectory
from throwcollect.sim.simulation import Simulation
from throwcollect.tasks.task import task_of, trajectory_of
from throwcollect.trial.conditions import Conditions, Settings, build_of
from throwcollect.trial.goals import trial_goals


class TrialRunner:
    """Begins trials and hands over their episodes; the caller calls `advance` in between.

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
        self._begun: JointTrajectory | None = None
        """Motion of the trial that was begun for a coordinator."""
        self._failure: MemberError | None = None

    def begin(self, trial: int, values: Mapping[str, float]) -> None:
        """Begin a trial, and give its controllers the goals that follow from its configuration.

        Args:
            trial: Number of the trial.
            values: Values by dotted key, which replace the values of the configuration.
        """
        # If this trial cannot begin, the next episode must not be judged by what is left of an earlier trial.
        self._begun = None
        config = with_values(self._simulation.config, values)
        trajectory = trajectory_of(config)
        self._simulation.lease(trial, config, trial_goals(robot_of(config), trajectory, start_posture(config)))
        self._begun = trajectory

    def release_lease(self) -> None:
        """Take the lease away from the trial that runs, so that its episode is not judged."""
        self._begun = None

    def drop(self) -> None:
        """Break off the trial that runs, and go back to the configuration."""
        self.release_lease()
        self._simulation.end_lease()

    def advance(self, *, watched: bool) -> None:
        """Run for a stretch of time; a trial in which the engine fails is dropped, and `hand_over` raises the error.

        Args:
            watched: Whether a client listens, so that the stretch has to be short.
        """
        try:
            self._simulation.advance(watched=watched)
        except MemberError as error:
            if self._begun is None:
                raise
            self.drop()
            self._failure = error

    def hand_over(self) -> Delivery | None:
        """Return the episode of a trial that has ended, only once; None if there is none.

        The episode is judged if `begin` began the trial.
        """
        failure, self._failure = self._failure, None
        if failure is not None:
            raise failure
        ended = self._simulation.episode()
        if ended is None:
            return None
        header, samples, states = ended
        begun, self._begun = self._begun, None
        trial = self._simulation.trial
        config = trial.begun.config
        if begun is not None:
            # A trial that a client sets up later starts from the configuration, and not from the values of this trial.
            trial.set_up_nothing()
        conditions = Conditions(
            build=build_of(config),
            settings=self._settings.digest,
            values=self._settings.find_replaced(config),
            trajectory=begun.digest if begun else "",
        )
        state, table = self._encoder.encode(samples, states)
        # The samples are judged as readers of the dataset see them: recorded velocities are in the ball's frame.
        result = self._judge(config, begun, table.samples, header) if begun else ""
        return Delivery(Episode(header, state), result, conditions.to_json())

    def _judge(self, config: Config, trajectory: JointTrajectory, samples: Samples, header: EpisodeHeader) -> str:
        """Judge a trial; return its result in JSON."""
        if (infinite := next(find_infinite_columns(samples), None)) is not None:
            raise ThrowcollectError(f"trial {header.trial}: {infinite}")
        # Writing finds results of a wrong kind. They are a fault of the task, too, so writing stands in this block.
        with explain_failure("tasks", config.task.name, f"judge trial {header.trial}"):
            return self._columns.to_json(task_of(config).judge(samples, header, trajectory))
