"""The runtime ``inprocess``: one simulation and the coordinator in this process, without nodes and ROS graph.

It is made for tests, for breakpoints in a controller or a task, and for Python programs that want a dataset without
further processes. The dataset is the same.
"""

from __future__ import annotations

import os
import time
from collections.abc import Callable
from contextlib import suppress
from typing import TYPE_CHECKING

from throwcollect.collect.runtimes.nodes import COORDINATOR, name_simulation
from throwcollect.collect.runtimes.run_record import NodeState, RunRecord
from throwcollect.collect.runtimes.runtime import Runtime, Session
from throwcollect.errors import Interrupted, LossError, ThrowcollectError

if TYPE_CHECKING:
    from throwcollect.collect.coordinator.collection import TrialCollection
    from throwcollect.config.schema import Config
    from throwcollect.dataset.summary import Info
    from throwcollect.sim.simulator import Simulator

_REPORT_EVERY_S = 0.2
_IDLE_S = 0.05
_SIMULATION = name_simulation(0)


class InProcessRuntime(Runtime):
    """Simulates in the launcher's own process; such a run cannot be joined or scaled."""

    can_be_scaled = False

    def describe(self, config: Config) -> str:
        """See `Runtime.describe`."""
        return "this process, with one simulation"

    def host(self, record: RunRecord, config: Config, *, warn: Callable[[str], None]) -> InProcess:
        """Make the host of a run in this process."""
        return InProcess(record, config)


class InProcess:
    """Simulates one trial after the other; a `runtime.Host`."""

    cleared = True

    def __init__(self, record: RunRecord, config: Config) -> None:
        self._record = record
        self._config = config
        self._reported_at = 0.0

    def close(self) -> None:
        """Do nothing: `collect` leaves nothing behind."""

    def collect(self, session: Session) -> Info:
        """See `runtime.Host.collect`; an interruption takes effect when the running trial has ended."""
        # These import messages of ROS, so they have to wait until the backend is chosen.
        from throwcollect.collect.coordinator.collection import TrialCollection
        from throwcollect.dataset.inspect import info
        from throwcollect.sim.simulator import Simulator

        directory = self._record.directory
        session.event("started", simulations=1)
        with TrialCollection.open(directory, say=session.reporter.say) as collection:
            collection.warn = session.reporter.warn
            simulator = Simulator(self._config, on_frame=lambda: None)
            try:
                self._simulate(collection, simulator, session)
            finally:
                simulator.close()
            if not collection.complete:
                raise self._record.interruption

            def wait() -> None:
                """Wait for a moment for the process that simulates some trials again."""
                if session.interruptions() > 1:
                    message = f"interrupted; the throws are in {directory}, the dataset is not finished"
                    raise Interrupted(message, hint=self._record.resume_command)
                time.sleep(_IDLE_S)

            # The dataset is finished even if trials are lost; the launcher reports the loss from the summary.
            with suppress(LossError):
                collection.finish(meanwhile=wait, say=session.reporter.say)
        return info(directory)

    def _simulate(self, collection: TrialCollection, simulator: Simulator, session: Session) -> None:
        """Simulate all trials, or drain."""
        handle = str(os.getpid())
        states = [NodeState(name, "running", 0, handle, None) for name in (_SIMULATION, COORDINATOR)]
        collection.join(_SIMULATION, _SIMULATION)
        while not collection.finished:
            if session.interruptions():
                collection.drain()
            if leased := collection.lease(_SIMULATION):
                try:
                    episode = simulator.run(collection.writer.plan.trial(leased[0]))
                except ThrowcollectError as error:
                    collection.refuse(_SIMULATION, leased[0], str(error))
                else:
                    collection.take_in(_SIMULATION, episode)
            else:
                collection.check_next()
            collection.look_after()
            session.nodes(states, endpoint=None, simulations=1)
            if time.monotonic() >= self._reported_at + _REPORT_EVERY_S:
                self._reported_at = time.monotonic()
                session.update(collection.progress())
        session.update(collection.progress())
