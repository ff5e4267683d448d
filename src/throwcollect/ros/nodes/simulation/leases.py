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

    def begin_next(self) -> TrialRefusal | None:
        """Begin the next trial if none runs; return the refusal of a trial that cannot begin."""
        if self._running is not None or not self._waiting:
            return None
        lease = self._waiting.popleft()
        try:
            self._simulator.begin(lease.trial, lease.values, seed=lease.seed, target=lease.target)
        except ThrowcollectError as error:
            self._simulator.drop()
            return self._refuse(lease, error)
        self._running = lease
        return None

    def fail(self, error: ThrowcollectError) -> TrialRefusal | None:
        """Drop the trial that runs, in which the engine has failed; return its refusal, or None if no lease runs."""
        lease, self._running = self._running, None
        if lease is None:
            return None
        self._simulator.drop()
        return self._refuse(lease, error)

    def hand_over(self) -> Episode | TrialRefusal | None:
        """Return the episode of the trial that has just ended, or its refusal; None if no trial has ended."""
        try:
            episode = self._simulator.hand_over()
        except ThrowcollectError as error:
            # Only episodes of leased trials are judged, so only they can be refused.
            lease, self._running = self._running, None
            return self._refuse(lease, error) if lease else None
        if episode is not None and self._running is not None:
            self._done.append(self._running.token)
            self._running = None
        return episode

    def _refuse(self, lease: Lease, error: ThrowcollectError) -> TrialRefusal:
        self._done.append(lease.token)
        return TrialRefusal(lease.trial, str(error))
