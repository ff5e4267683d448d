"""One simulation and the coordinator in this process: no nodes, no ROS graph, the same dataset.

For tests, for breakpoints in a controller or a task, and for Python programs that want a dataset without processes.
"""

from __future__ import annotations

import os
import time
from collections.abc import Callable
from contextlib import suppress
from typing import TYPE_CHECKING

from throwcollect.errors import Interrupted, LossError, ThrowcollectError
from throwcollect.runtimes.nodes import COORDINATOR, simulation_name
from throwcollect.runtimes.runtime import NodeState, Place, Runtime, Session

if TYPE_CHECKING:
    from throwcollect.config.schema import Config
    from throwcollect.coordinator.collection import TrialCollection
    from throwcollect.dataset.summary import Info
    from throwcollect.replay.throw import Replayer

_TELL_EVERY_S = 0.2
_IDLE_S = 0.05
_SIMULATION = simulation_name(0)


class InProcessRuntime(Runtime):
    """The launcher's own process; there is nothing to join, and nothing to scale."""

    can_be_scaled = False

    def in_words(self, config: Config) -> str:
        """Where trials are simulated."""
        return "this process, with one simulation"

    def simulations(self, config: Config) -> int:
        """Number of simulations that a run begins with."""
        return 1

    def host(self, place: Place, config: Config, *, warn: Callable[[str], None]) -> InProcess:
        """This process."""
        return InProcess(place, config)


class InProcess:
    """Simulates one trial after the other; see `runtime.Host` for what it offers.

    Args:
        place: The run.
        config: Its configuration.
    """

    cleared = True

    def __init__(self, place: Place, config: Config) -> None:
        self._place = place
        self._config = config
        self._told_at = 0.0

    def close(self) -> None:
        """Nothing is left when `collect` has returned."""

    def collect(self, session: Session) -> Info:
        """See `runtime.Host.collect`; a trial that runs is finished before anybody's wish to stop is heeded.

        Raises:
            Interrupted: If somebody stopped it before every trial had ended.
        """
        # These take messages of ROS along, so they are imported when it is known what ROS is to run on.
        from throwcollect.coordinator.collection import TrialCollection
        from throwcollect.dataset.inspect import info
        from throwcollect.replay.throw import Replayer

        directory = self._place.directory
        session.event("started", simulations=1)
        with TrialCollection.open(directory, say=session.say) as collection:
            collection.warn = session.warn
            simulation = Replayer(self._config)
            try:
                self._simulate(collection, simulation, session)
            finally:
                simulation.close()
            if not collection.complete:
                message = f"interrupted; finished throws are in {directory}, the dataset is not complete"
                raise Interrupted(message, hint=self._place.way_on)
            # The dataset is finished even if trials are lost; whoever reads its summary says so.
            with suppress(LossError):
                collection.finish(meanwhile=lambda: time.sleep(_IDLE_S), say=session.say)
        return info(directory)

    def _simulate(self, collection: TrialCollection, simulation: Replayer, session: Session) -> None:
        """Have all trials run, or drain.

        Raises:
            WorkerError: If the simulation refuses every trial.
            DatasetError: If the dataset cannot be written.
        """
        handle = str(os.getpid())
        states = [NodeState(name, "running", 0, handle, None) for name in (_SIMULATION, COORDINATOR)]
        collection.join(_SIMULATION, _SIMULATION)
        while not collection.finished:
            if session.interruptions():
                collection.drain()
            if leased := collection.lease(_SIMULATION):
                try:
                    delivery = simulation.delivery(collection.writer.plan.trial(leased[0]))
                except ThrowcollectError as error:
                    collection.refuse(_SIMULATION, leased[0], str(error))
                else:
                    collection.take_in(_SIMULATION, delivery)
            else:
                collection.grow_plan()
            if collection.backlog:
                collection.write_one()
            collection.look_after()
            session.nodes(states, endpoint=None, simulations=1)
            if time.monotonic() >= self._told_at + _TELL_EVERY_S:
                self._told_at = time.monotonic()
                session.update(collection.progress())
        session.update(collection.progress())
