"""Simulates one trial in this process with the controllers and the physics of a simulation node, without ROS 2."""

from __future__ import annotations

from weakref import finalize

from throwcollect.config.schema import Config
from throwcollect.episode.episode_message import Delivery, Episode
from throwcollect.sim.simulation import Simulation
from throwcollect.sim.trial_runner import TrialRunner
from throwcollect.sweep.trials import Trial


class Replayer:
    """Runs trials of one collection, one after the other, and ignores the real-time factor of its configuration.

    Attributes:
        close: Frees the world, as the end of this object does, too; no trial can be run afterwards.

    Raises:
        ConfigError: If the configuration does not describe a world.
        WorkerError: If the physics engine does not start.
    """

    def __init__(self, config: Config) -> None:
        self._simulation = Simulation(config)
        self._simulation.real_time_factor = None
        self._runner = TrialRunner(self._simulation)
        self.close = finalize(self, self._simulation.world.close)
        # This is not called when the process ends, which frees all worlds, because engines may be unloaded by then.
        self.close.atexit = False

    def run(self, trial: Trial) -> Episode:
        """Simulate a trial for its episode alone; see `delivery`."""
        return self.delivery(trial).episode

    def delivery(self, trial: Trial) -> Delivery:
        """Simulate a trial with the collection's configuration, and return its episode, result and conditions.

        The trial need not be in the plan.
        """
        self._runner.begin(trial.number, trial.values)
        while (delivery := self._runner.hand_over()) is None:
            self._runner.advance(watched=False)
        return delivery
