"""Simulates one trial in this process, by the controllers and the physics of a simulation node, without the graph."""

from __future__ import annotations

from throwcollect.config.schema import Config
from throwcollect.config.values import is_physics, with_values
from throwcollect.coordinator.goals import trial_goals
from throwcollect.episode.channels import Channels
from throwcollect.episode.chunk import ChunkEncoder
from throwcollect.episode.message import Delivery, Episode
from throwcollect.errors import ThrowcollectError
from throwcollect.robots.description import full_description, start_posture
from throwcollect.sim.present_trial import TrialSetup
from throwcollect.sim.simulation import Simulation
from throwcollect.sweep.plan import Plan
from throwcollect.tasks.trajectory import throw_trajectory


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
        self._simulation = Simulation(config)
        self._simulation.real_time_factor = None
        self._encoder = ChunkEncoder(Channels(config, full_description(config)), level=config.record.zstd_level)

    def close(self) -> None:
        """Free the world; no trial can be run afterwards."""
        self._simulation.world.close()

    def run(self, plan: Plan, trial: int) -> Episode:
        """The episode of a trial; see `delivery`."""
        return self.delivery(plan, trial).episode

    def delivery(self, plan: Plan, trial: int) -> Delivery:
        """The episode of a trial, and what it was simulated with.

        Args:
            plan: The plan that has it.
            trial: Its number.

        Raises:
            ThrowcollectError: If a controller refuses its goal, as it would in a collection.
        """
        simulation = self._simulation
        values = plan.trials[trial].values
        config = plan.config_of(plan.trials[trial])
        goals = trial_goals(throw_trajectory(config), start_posture(config))
        physics = with_values(self._config, {key: value for key, value in values.items() if is_physics(key)})
        simulation.trial.setup = TrialSetup(trial, tuple(goals), physics)
        simulation.reset()
        for controller, goal in goals.items():
            refusal = simulation.submit(controller, trial, goal)
            if refusal is not None:
                raise ThrowcollectError(f"trial {trial}: {controller} refuses its goal: {refusal}")
        while (ended := simulation.episode()) is None:
            simulation.advance(watched=False)
        header, samples, states = ended
        return Delivery(Episode(header, self._encoder.encode(samples, states)), simulation.trial.conditions().to_json())
