"""The trials that a coordinator wants of a simulation, in their order."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable

from throwcollect.episode.episode_message import Episode, TrialRefusal
from throwcollect.errors import ThrowcollectError
from throwcollect.plan.lease import Lease
from throwcollect.sim.live import LiveSimulator

_REMEMBERED = 1000
"""Number of ended leases that are remembered, because a list sent earlier may still name them; no list is as long."""


class LeaseQueue:
    """Holds the leases of a simulation and begins them one after the other."""

    def __init__(self, simulator: LiveSimulator) -> None:
        self._simulator = simulator
        self._running: Lease | None = None
        self._waiting: deque[Lease] = deque()
        self._done: deque[str] = deque(maxlen=_REMEMBERED)
        self._handed: list[Episode | TrialRefusal] = []

    def replace(self, leases: Iterable[Lease]) -> None:
        """Have these trials simulated in this order, and no others; the present trial goes on if it is among them."""
        pending = [lease for lease in leases if lease.token not in self._done]
        if (running := self._running) is not None:
            # A new lease of the same trial asks for the episode that is being made.
            again = (lease for lease in pending if (lease.trial, lease.values) == (running.trial, running.values))
            self._running = next(again, None)
            if self._running is None:
                self._simulator.drop()
        self._waiting = deque(lease for lease in pending if lease is not self._running)
        self._begin_next()

    def fail(self, error: ThrowcollectError) -> None:
        """Refuse the trial that runs, in which the engine has failed, and begin the next one.

        Raises:
            ThrowcollectError: The error, if no lease runs.
        """
        if self._running is None:
            raise error
        self._refuse(self._running, error)
        self._begin_next()

    def collect(self) -> list[Episode | TrialRefusal]:
        """Return episodes and refusals of trials that have ended since the last call, and begin the next trial."""
        if (lease := self._running) is not None:
            try:
                if (episode := self._simulator.hand_over()) is not None:
                    self._end(lease, episode)
            except ThrowcollectError as error:
                self._refuse(lease, error)
            self._begin_next()
        handed, self._handed = self._handed, []
        return handed

    def _begin_next(self) -> None:
        while self._running is None and self._waiting:
            self._running = lease = self._waiting.popleft()
            try:
                self._simulator.begin(lease.trial, lease.values, seed=lease.seed, target=lease.target)
            except ThrowcollectError as error:
                self._refuse(lease, error)

    def _refuse(self, lease: Lease, error: ThrowcollectError) -> None:
        self._simulator.drop()
        self._end(lease, TrialRefusal(lease.trial, str(error)))

    def _end(self, lease: Lease, handed: Episode | TrialRefusal) -> None:
        self._running = None
        self._done.append(lease.token)
        self._handed.append(handed)
