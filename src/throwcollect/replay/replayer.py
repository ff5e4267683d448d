"""Simulates one trial in this process with the controllers and the physics of a simulation node, without ROS 2."""

from __future__ import annotations

from weakref import finalize

from throwcollect.config.schema import Config
from throwcollect.episode.episode_message import Delivery, Episode
from throwcollect.sim.simulation import Simulation
from throwcollect.sim.trial_runner import TrialRunner
from throwcollect.sweep.trials import Trial


class Replayer:
    """Runs trials of one collection, one after the other, without its slow motion for onlookers.

    Attributes:
        close: Frees the world, as the end of this object does, too; no trial can be run afterwards.

    Raises:
        ConfigError: If it does not describe a world.
        WorkerError: If the physics engine does not start.
    """

    def __init__(self, config: Config) -> None:
        self._simulation = Simulation(config)
        self._simulation.real_time_factor = None
        self._runner = TrialRunner(self._simulation)
        self.close = finalize(self, self._simulation.world.close)
        # The end of the process frees all worlds, and engines may be gone by then.
        self.close.atexit = False

    def run(self, trial: Trial) -> Episode:
        """Simulate a trial for its episode alone; see `delivery`."""
        return self.delivery(trial).episode

    def delivery(self, trial: Trial) -> Delivery:
        """Simulate a trial of the collection, whether its plan has it or not: episode, result and conditions.

        Raises:
            ThrowcollectError: If a controller refuses its goal, or the samples are not finite, as in a collection.
        """
        self._runner.begin(trial.number, trial.values)
        while (delivery := self._runner.hand_over()) is None:
            self._simulation.advance(watched=False)
        return delivery
