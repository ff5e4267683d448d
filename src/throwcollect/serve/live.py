"""Simulations that are slowed down to real time as long as somebody watches them live.

Whoever watches one shares the lock of a file beside the key of its run. The lock goes with its process, so any server
sees at the file which simulations nobody watches any more, be it that the watchers' server was killed.
"""

from __future__ import annotations

import asyncio
import fcntl
import os
from contextlib import suppress
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

from throwcollect.config.loader import load
from throwcollect.dataset.directory import config_path
from throwcollect.errors import ConfigError, NotFoundError, ThrowcollectError, WorkerError
from throwcollect.runs.control import set_parameter
from throwcollect.runs.records import Records, Run

_PARAMETER = "sim.real_time_factor"
_REAL_TIME, _FULL_SPEED = 1.0, 0.0
_SWEEP_S = 10.0
_DIRECTORY = "live"


@dataclass(frozen=True)
class Hold:
    """One watcher of one simulation.

    Attributes:
        run: The run.
        simulation: Name of the simulation.
        lock: Descriptor of the file whose lock is shared.
    """

    run: Run
    simulation: str
    lock: int

    def let_go(self) -> None:
        """Leave; the last one gives the simulation the speed back that its configuration asks for."""
        _leave(self.run, self.simulation, self.lock)


def take(run: Run, simulation: str) -> Hold:
    """Slow a simulation down to real time.

    Args:
        run: The run.
        simulation: Name of the simulation.

    Raises:
        NotFoundError: If the run has no such simulation that runs.
        WorkerError: If that does not answer, or does not do so.
        ConfigError: If the run's key cannot be read.
    """
    if not _runs(run, simulation):
        raise NotFoundError(f"run {run.id}: no simulation {simulation!r} runs")
    try:
        lock = _share(_note(run, simulation))
    except OSError as error:
        raise WorkerError(f"run {run.id}: {simulation} cannot be slowed down: {error}") from error
    try:
        _set_speed(run, simulation, _REAL_TIME)
    except ThrowcollectError:
        # It may do so yet; the file says that somebody has to let go of it.
        os.close(lock)
        raise
    return Hold(run, simulation, lock)


async def keep_letting_go() -> None:
    """Let go again and again of simulations that nobody watches any more, as when a server was killed."""
    while True:
        await asyncio.to_thread(let_go_of_left)
        await asyncio.sleep(_SWEEP_S)


def let_go_of_left() -> None:
    """Let go of simulations that nobody watches any more."""
    # Where records cannot be read for a while, the next attempt may find what is left.
    with suppress(ThrowcollectError, OSError):
        for run in Records().all():
            for note in sorted(_note(run, "").glob("*")) if run.status == "running" else ():
                with suppress(FileNotFoundError):
                    _leave(run, note.name, os.open(note, os.O_RDWR))


def _note(run: Run, simulation: str) -> Path:
    return run.key.directory.parent / _DIRECTORY / simulation


def _share(path: Path) -> int:
    """Descriptor of a file whose lock is shared."""
    path.parent.mkdir(exist_ok=True)
    while True:
        lock = os.open(path, os.O_RDWR | os.O_CREAT, 0o600)
        fcntl.flock(lock, fcntl.LOCK_SH)
        with suppress(FileNotFoundError):
            if os.path.samestat(os.fstat(lock), path.stat()):
                return lock
        # The last one who left has removed it meanwhile.
        os.close(lock)


def _leave(run: Run, simulation: str, lock: int) -> None:
    """Close the file of a simulation; without others who share its lock, the simulation gets its speed back."""
    try:
        fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return
    else:
        try:
            now = run.now()
            if _runs(now, simulation):
                _set_speed(now, simulation, None)
        except ConfigError:
            # The run was forgotten, so there is nothing left that could be slow.
            pass
        except WorkerError:
            # It may be busy just now: the file stays, and says that somebody has to try again.
            return
        _note(run, simulation).unlink(missing_ok=True)
    finally:
        os.close(lock)


def _runs(run: Run, simulation: str) -> bool:
    nodes = run.record.nodes if run.status == "running" else ()
    return any(node.name == simulation and node.status == "running" for node in nodes)


def _set_speed(run: Run, simulation: str, factor: float | None) -> None:
    """Have a simulation keep to a real-time factor; None for that of its configuration.

    Raises:
        ConfigError: If the run's configuration or key cannot be read.
        WorkerError: If the simulation does not do so.
    """
    config = load(config_path(run.place.directory))
    wanted = (config.sim.real_time_factor or _FULL_SPEED) if factor is None else factor
    (result,) = set_parameter(run, [find_node(run, simulation)], _PARAMETER, wanted)
    if not result.successful:
        raise WorkerError(f"run {run.id}: {simulation} cannot change its speed: {result.reason}")


def find_node(run: Run, simulation: str) -> str:
    """Name of the node of a simulation, with its namespace.

    Raises:
        ConfigError: If the run's configuration cannot be read.
    """
    path = config_path(run.place.directory)
    changed_ns = path.stat().st_mtime_ns if path.is_file() else 0
    return f"/{simulation}" if _has_root_namespace(path, changed_ns) else f"/{simulation}/{simulation}"


@lru_cache(maxsize=64)
def _has_root_namespace(path: Path, _changed_ns: int) -> bool:
    return load(path).run.root_namespace
