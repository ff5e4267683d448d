"""Simulates one trial in this process, by the controllers and the physics of a simulation node, without the graph."""

from __future__ import annotations

from throwcollect.config.key import Effect
from throwcollect.config.schema import Config
from throwcollect.config.values import sweepable_keys, with_values
from throwcollect.coordinator.goals import trial_goals
from throwcollect.episode.channels import Channels
from throwcollect.episode.chunk import ChunkEncoder
from throwcollect.episode.message import Delivery, Episode
from throwcollect.errors import ThrowcollectError
from throwcollect.robots.description import full_description, robot_of, start_posture
from throwcollect.sim.present_trial import TrialSetup
from throwcollect.sim.simulation import Simulation
from throwcollect.sweep.plan import Trial
from throwcollect.tasks.task import task_of


class Replayer:
    """Runs trials of one collection, one after the other.

    Args:
        config: Its configuration; slow motion for onlookers is left out.

    Raises:
        ConfigError: If it does not describe a world.
        WorkerError: If the physics engine does not start.
    """

    def __init__(self, config: Config) -> None:
        self._config = config
        self._physics = set(sweepable_keys(config, Effect.PHYSICS))
        self._simulation = Simulation(config)
        self._simulation.real_time_factor = None
        self._encoder = ChunkEncoder(Channels(config, full_description(config)), level=config.record.zstd_level)

    def close(self) -> None:
        """Free the world; no trial can be run afterwards."""
        self._simulation.world.close()

    def run(self, trial: Trial) -> Episode:
        """The episode of a trial; see `delivery`."""
        return self.delivery(trial).episode

    def delivery(self, trial: Trial) -> Delivery:
        """The episode of a trial, and what it was simulated with.

        Args:
            trial: A trial of the collection, whether its plan has it or not.

        Raises:
            ThrowcollectError: If a controller refuses its goal, as it would in a collection.
        """
        simulation = self._simulation
        config = with_values(self._config, trial.values)
        goals = trial_goals(robot_of(config), task_of(config).trajectory(), start_posture(config))
        physics = with_values(self._config, {key: trial.values[key] for key in trial.values if key in self._physics})
        simulation.trial.setup = TrialSetup(trial.number, tuple(goals), physics)
        simulation.reset()
        for controller, goal in goals.items():
            refusal = simulation.submit(controller, trial.number, goal)
            if refusal is not None:
                raise ThrowcollectError(f"trial {trial.number}: {controller} refuses its goal: {refusal}")
        while (ended := simulation.episode()) is None:
            simulation.advance(watched=False)
        header, samples, states = ended
        return Delivery(Episode(header, self._encoder.encode(samples, states)), simulation.trial.conditions().to_json())
