"""Simulations that are slowed down to real time as long as they are watched live.

For each simulation that was watched, there is a file next to the key of the run, which is not empty as long as the
simulation is slow. Each watcher holds a shared lock of the file, which ends with the server. So any server can find the
simulations that are no longer watched, even if the server of their watchers was killed.
"""

from __future__ import annotations

import asyncio
import fcntl
import os
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager, suppress
from pathlib import Path

from throwcollect.collect.runs.control import set_parameter
from throwcollect.collect.runs.records import Records
from throwcollect.collect.runs.run import Run
from throwcollect.config.loader import load
from throwcollect.config.schema import Config
from throwcollect.dataset.directory import config_path
from throwcollect.errors import ConfigError, DatasetError, NotFoundError, ThrowcollectError, WorkerError
from throwcollect.serve.state import simulations_of

_PARAMETER = "sim.real_time_factor"
_REAL_TIME, _FULL_SPEED = 1.0, 0.0
_SWEEP_S = 10.0
_DIRECTORY = "live"


def slow_down(run: Run, simulation: str) -> int:
    """Slow a simulation down to real time, and return the descriptor of its file, for `restore_speed`."""
    if not _runs(run, simulation):
        raise NotFoundError(f"run {run.id}: no simulation {simulation!r} runs")
    path = _find_lock_path(run, simulation)
    path.parent.mkdir(exist_ok=True)
    lock = os.open(path, os.O_RDWR | os.O_CREAT, 0o600)
    fcntl.flock(lock, fcntl.LOCK_SH)
    os.pwrite(lock, b"slow", 0)
    try:
        _set_speed(run, simulation, _REAL_TIME)
    except ThrowcollectError:
        # The simulation may have slowed down nevertheless. The file stays, so `restore_abandoned` restores the speed.
        os.close(lock)
        raise
    return lock


def restore_speed(run: Run, simulation: str, lock: int) -> None:
    """Stop watching; the last watcher gives the simulation the speed of its configuration again."""
    # An error closes the file and leaves it as it is: another watcher has its lock, or the simulation may be busy, so
    # that `restore_abandoned` tries again.
    with suppress(BlockingIOError, WorkerError), os.fdopen(lock, "r+b") as file:
        # This turns the shared lock into an exclusive one, which fails if there is another watcher.
        fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        # A run that was forgotten, or whose configuration was removed, has no slow simulation.
        with suppress(ConfigError, DatasetError):
            run = run.now()
            if _runs(run, simulation):
                _set_speed(run, simulation, None)
        file.truncate(0)


@asynccontextmanager
async def restore_speeds_meanwhile(_: object) -> AsyncIterator[None]:
    """Call `restore_abandoned` every few seconds: the server of a watcher may be killed, or a simulation be busy."""

    async def keep_restoring() -> None:
        while True:
            await asyncio.to_thread(restore_abandoned)
            await asyncio.sleep(_SWEEP_S)

    restoring = asyncio.create_task(keep_restoring())
    yield
    restoring.cancel()


def restore_abandoned() -> None:
    """Give simulations that are no longer watched the speed of their configuration again."""
    # If records cannot be read for a while, a later attempt finds the same files.
    with suppress(ThrowcollectError, OSError):
        for run in Records().all():
            for note in sorted(_find_lock_path(run, "").glob("*")) if run.status == "running" else ():
                if note.stat().st_size:
                    restore_speed(run, note.name, os.open(note, os.O_RDWR))


def _find_lock_path(run: Run, simulation: str) -> Path:
    """Path of the file whose lock the watchers of a simulation share."""
    return run.key.directory.parent / _DIRECTORY / simulation


def _runs(run: Run, simulation: str) -> bool:
    return run.status == "running" and simulation in simulations_of(run.record.nodes)


def _set_speed(run: Run, simulation: str, factor: float | None) -> None:
    """Set the real-time factor of a simulation; None for that of its configuration."""
    config = load(config_path(run.record.directory))
    value = (config.sim.real_time_factor or _FULL_SPEED) if factor is None else factor
    (result,) = set_parameter(run, [name_node(config, simulation)], _PARAMETER, value)
    if not result.successful:
        raise WorkerError(f"run {run.id}: {simulation} cannot change its speed: {result.reason}")


def name_node(config: Config, simulation: str) -> str:
    """Name of the node of a simulation, with its namespace."""
    return f"/{simulation}" if config.run.root_namespace else f"/{simulation}/{simulation}"
