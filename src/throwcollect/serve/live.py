"""Simulations that are slowed down to real time as long as somebody watches them live.

Each is noted in a file beside the key of its run, so whoever serves after a server that was killed lets go of it.
"""

from __future__ import annotations

import asyncio
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path

from throwcollect.config.loader import load
from throwcollect.dataset.directory import config_path
from throwcollect.errors import NotFoundError, ThrowcollectError
from throwcollect.runs.control import set_parameter
from throwcollect.runs.records import Records, Run

_PARAMETER = "sim.real_time_factor"
_REAL_TIME, _FULL_SPEED = 1.0, 0.0


@dataclass
class Hold:
    """One watcher of one simulation.

    Attributes:
        run: The run.
        simulation: Name of the simulation.
        holds: Where it is counted.
    """

    run: Run
    simulation: str
    holds: LiveHolds

    async def let_go(self) -> None:
        """Leave; the last one gives the simulation its speed back."""
        await self.holds.let_go(self)


@dataclass
class LiveHolds:
    """Counts the watchers of each simulation."""

    _watchers: dict[tuple[str, str], int] = field(default_factory=dict)
    _changing: asyncio.Lock = field(default_factory=asyncio.Lock)

    async def take(self, run: Run, simulation: str) -> Hold:
        """Slow a simulation down to real time, unless somebody watches it already.

        Args:
            run: The run.
            simulation: Name of the simulation.

        Raises:
            NotFoundError: If the run has no such simulation that runs.
            WorkerError: If that does not answer.
        """
        if not any(node.name == simulation and node.status == "running" for node in run.record.nodes):
            raise NotFoundError(f"run {run.id}: no simulation {simulation!r} runs")
        key = run.id, simulation
        async with self._changing:
            if not self._watchers.get(key):
                _note(run, simulation).parent.mkdir(exist_ok=True)
                _note(run, simulation).touch()
                await asyncio.to_thread(_set_speed, run, simulation, _REAL_TIME)
            self._watchers[key] = self._watchers.get(key, 0) + 1
        return Hold(run, simulation, self)

    async def let_go(self, hold: Hold) -> None:
        """Take a watcher off; without one, the simulation is as fast as its configuration says."""
        key = hold.run.id, hold.simulation
        async with self._changing:
            self._watchers[key] -= 1
            if not self._watchers[key]:
                del self._watchers[key]
                await asyncio.to_thread(_let_go, hold.run, hold.simulation)

    async def let_go_of_left(self) -> None:
        """Let go of simulations that a server which was killed has slowed down."""
        for run in await asyncio.to_thread(lambda: Records().all()):
            if run.status == "running" and _note(run, "").is_dir():
                for note in list(_note(run, "").iterdir()):
                    await asyncio.to_thread(_let_go, run, note.name)


def _note(run: Run, simulation: str) -> Path:
    return run.key.directory.parent / "live" / simulation


def _let_go(run: Run, simulation: str) -> None:
    # A run that is over, or a simulation that is gone, needs nothing any more.
    with suppress(ThrowcollectError):
        factor = load(config_path(run.place.directory)).sim.real_time_factor or _FULL_SPEED
        _set_speed(run.now(), simulation, factor)
    _note(run, simulation).unlink(missing_ok=True)


def _set_speed(run: Run, simulation: str, factor: float) -> None:
    set_parameter(run, [f"/{simulation}/{simulation}"], _PARAMETER, factor)
