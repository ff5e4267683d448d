"""The records of this machine's runs, each with a lock that the launcher of the run holds as long as it lives.

The files lie in a directory of the user and not in datasets, so that a dataset does not depend on who looked at it::

    runs/<run>.json     the record; each change writes the whole file
    runs/<run>.lock     locked by the launcher, see `state_directory.is_locked`
    runs/<run>/key/     the key of the run, with which everybody can join who can read it
    runs/<run>/         further files of a run whose dataset has no directory on this machine

Only the owner can read these files.
"""

from __future__ import annotations

import fcntl
import os
import secrets
import shutil
import subprocess
import time
from collections.abc import Iterable
from contextlib import ExitStack, suppress
from dataclasses import dataclass, field, replace
from datetime import datetime, timedelta, timezone
from pathlib import Path
from typing import Any, Literal

from pydantic import TypeAdapter, ValidationError
from pydantic_core import to_json

from throwcollect.errors import ConfigError, ConflictError, NotFoundError
from throwcollect.files import beside, open_log, write_all
from throwcollect.own_process import make_command
from throwcollect.ros.connection import Connection
from throwcollect.run_key import RunKey
from throwcollect.runs.run_record import RunRecord
from throwcollect.runtimes.node_logs import NodeLogs
from throwcollect.runtimes.nodes import LAUNCHER
from throwcollect.runtimes.registry import find_runtime
from throwcollect.runtimes.runtime import NodeState, Place
from throwcollect.state_directory import is_locked, state_directory, unusable
from throwcollect.units import NS_PER_S
from throwcollect.wording import command

_REMEMBERED = timedelta(days=7)
"""Records of runs that have ended are kept for this long."""
_LOCK_PATIENCE_S = 1.0
"""`Records.take` tries for this long, because another process may hold the lock for a moment in `is_locked`."""


@dataclass(frozen=True)
class Run:
    """A run, as processes other than its launcher see it.

    Attributes:
        record: The record of the run, as it was when it was read.
        lives: Whether the launcher lived at that time.
        key: The key that the router asks for.
    """

    record: RunRecord
    lives: bool
    key: RunKey
    records: Records = field(repr=False, compare=False)

    @property
    def id(self) -> str:
        """Id of the run."""
        return self.record.run

    def now(self) -> Run:
        """Read the record of the run again."""
        return self.records.get(self.id)

    @property
    def place(self) -> Place:
        """The place of the run."""
        return self.record.place(self.key)

    @property
    def connection(self) -> Connection | None:
        """The way into the ROS graph of the run; None while it has no router."""
        record = self.record
        if record.endpoint is None:
            return None
        return Connection(record.endpoint, self.key, record.domain_id, record.middleware)

    @property
    def nodes(self) -> tuple[NodeState, ...]:
        """The nodes that can still run; none if the launcher died and they were its processes, as these end with it."""
        return self.record.nodes if self.status != "died" or _may_outlive(self.record) else ()

    @property
    def status(self) -> Literal["running", "ended", "abandoned", "died"]:
        """State of the run; ``abandoned``: it ended but left containers; ``died``: its launcher died before the end."""
        if self.record.ended is not None:
            return "abandoned" if self.record.left else "ended"
        return "running" if self.lives else "died"


_ADAPTER = TypeAdapter(RunRecord)


class OpenRun:
    """A run that this process launches; the process holds the lock of the run until `close` or until it dies.

    Attributes:
        directory: Directory of the key, and of the files of a run whose dataset has no directory on this machine.
        lock: Descriptor of the locked file, which a process that takes the run over inherits; -1 once it is closed.
    """

    def __init__(self, runs: Path, run: str, lock: int) -> None:
        self.run = run
        self.directory = runs / run
        self.key = _key(runs, run)
        self.lock = lock
        self._runs = runs
        self._record: RunRecord | None = None

    @property
    def place(self) -> Place:
        """The place of the run."""
        return self.record.place(self.key)

    @property
    def record(self) -> RunRecord:
        """The record of the run."""
        if self._record is None:
            self._record = _read(self._runs / f"{self.run}.json")
        return self._record

    def write(self, record: RunRecord) -> None:
        """Write the record."""
        self._record = record
        path = self._runs / f"{self.run}.json"
        try:
            with beside(path, mode=0o600) as descriptor:
                write_all(descriptor, _ADAPTER.dump_json(record, indent=1))
        except OSError as error:
            raise unusable(path, error) from error

    def update(self, **changes: Any) -> None:
        """Change fields of the record, and write it if that makes a difference."""
        changed = replace(self.record, **changes)
        if changed != self.record:
            self.write(changed)

    def start_process(self, command: str, logs: Path, *, stdin: int) -> subprocess.Popen[bytes]:
        """Start a command of throwcollect that takes this run over, and prints into the launcher's log.

        The process has a session of its own, so that it outlives the terminal. It holds the lock from its first moment,
        so that the run never looks dead.
        """
        words = [*make_command(), command, self.run, "--lock", str(self.lock)]
        with open(open_log(NodeLogs(logs).path(LAUNCHER)), "ab") as log:
            return subprocess.Popen(
                words, stdin=stdin, stdout=log, stderr=subprocess.STDOUT, start_new_session=True, pass_fds=[self.lock]
            )

    def close(self) -> None:
        """Release the lock of the run; the record stays."""
        if self.lock >= 0:
            os.close(self.lock)
            self.lock = -1

    def forget(self) -> None:
        """Remove the record and the files of the run, but no dataset in a directory, and release the lock."""
        # The record is removed first and the lock is released last: nobody finds or takes a half-removed run.
        for path in (self._runs / f"{self.run}.json", self._runs / f"{self.run}.lock"):
            with suppress(OSError):
                path.unlink()
        shutil.rmtree(self.directory, ignore_errors=True)
        self.close()


class Records:
    """All runs of this user on this machine.

    Raises:
        ConfigError: If the directory of the records cannot be used.
    """

    def __init__(self) -> None:
        self._runs = state_directory() / "runs"
        try:
            self._runs.mkdir(mode=0o700, exist_ok=True)
            # If the user has named the directory above, others may be allowed to read it, but not the records.
            self._runs.chmod(0o700)
        except OSError as error:
            raise unusable(self._runs, error) from error

    def new(self, name: str, *, run: str | None = None) -> OpenRun:
        """Make a new run, with a key but without a record yet; forget runs that ended a week ago.

        If no id is given, this makes one that begins with `name`, the name of the collection.
        """
        self._forget_old()
        while True:
            chosen = run or f"{name}-{secrets.token_hex(2)}"
            try:
                lock = os.open(self._runs / f"{chosen}.lock", os.O_RDWR | os.O_CREAT | os.O_EXCL, 0o600)
            except FileExistsError as error:
                if run:
                    raise ConflictError(f"there is a run {run} already") from error
                continue
            except OSError as error:
                raise unusable(self._runs / f"{chosen}.lock", error) from error
            opened = OpenRun(self._runs, chosen, lock)
            with ExitStack() as undo:
                undo.callback(opened.forget)
                try:
                    # This waits only for `is_locked` of another process, which may have the new lock for a moment.
                    fcntl.flock(lock, fcntl.LOCK_EX)
                    opened.directory.mkdir(mode=0o700, exist_ok=True)
                except OSError as error:
                    raise unusable(opened.directory, error) from error
                opened.key.create()
                undo.pop_all()
            return opened

    def inherit(self, run: str, lock: int) -> OpenRun:
        """Open the run that the parent process has handed over, with the descriptor of its locked file."""
        return OpenRun(self._runs, run, lock)

    def take(self, run: str) -> OpenRun | None:
        """Open a run whose launcher is dead, so that this process can launch or forget it; None if it lives."""
        path = self._runs / f"{run}.lock"
        deadline = time.monotonic() + _LOCK_PATIENCE_S
        while True:
            try:
                # The file is made if it does not exist, because `down` also takes runs that left only containers.
                lock = os.open(path, os.O_RDWR | os.O_CREAT, 0o600)
            except OSError as error:
                raise unusable(path, error) from error
            with ExitStack() as given_up:
                given_up.callback(os.close, lock)
                with suppress(BlockingIOError, FileNotFoundError):
                    fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
                    # The last holder of the lock may have removed the file, and another process made a new one; then
                    # this lock is of no use.
                    if os.path.samestat(os.fstat(lock), path.stat()):
                        given_up.pop_all()
                        return OpenRun(self._runs, run, lock)
            if time.monotonic() > deadline:
                return None
            time.sleep(0.01)

    def ids(self) -> list[str]:
        """Sorted ids of all runs that have a record, even a damaged one."""
        return sorted(path.stem for path in self._runs.glob("*.json"))

    def get(self, run: str) -> Run:
        """Read a run."""
        # A launcher writes the end of the run before it releases the lock. So the lock is checked before the record
        # is read; otherwise a run that ends in between would look dead.
        lives = self.lives(run)
        return Run(_read(self._runs / f"{run}.json"), lives, _key(self._runs, run), self)

    def all(self) -> list[Run]:
        """All runs whose records can be read, the latest last."""
        return self.read(self.ids())

    def into(self, directory: Path) -> list[Run]:
        """Runs that collect, or have collected, into a directory, and not into a volume; the latest last."""
        name = os.path.realpath(directory)
        # There may be thousands of records, so only those that contain the directory's name are parsed.
        written = to_json(name)
        runs = self.read(run for run in self.ids() if written in _read_bytes(self._runs / f"{run}.json"))
        return [run for run in runs if run.record.volume is None and run.record.directory == name]

    def read(self, ids: Iterable[str]) -> list[Run]:
        """Those of the runs whose records can be read, the latest last."""
        runs = []
        for run in ids:
            with suppress(ConfigError):
                runs.append(self.get(run))
        return sorted(runs, key=lambda run: run.record.started)

    def read_change_ns(self, run: str) -> int | None:
        """Time of the last change of a run's record, in ns of the file system's clock; None without a record."""
        try:
            return (self._runs / f"{run}.json").stat().st_mtime_ns
        except OSError:
            return None

    def lives(self, run: str) -> bool:
        """Whether the launcher of a run lives."""
        return is_locked(self._runs / f"{run}.lock")

    def _forget_old(self) -> None:
        before = datetime.now(timezone.utc) - _REMEMBERED

        def may_be_old(run: str) -> bool:
            """Whether a record was written long ago, by the time of its file, so that the record need not be read."""
            changed_ns = self.read_change_ns(run)
            return changed_ns is not None and changed_ns / NS_PER_S <= before.timestamp()

        for run in self.read(filter(may_be_old, self.ids())):
            record = run.record
            # The record of a run whose nodes may outlive its launcher is kept: nothing else describes these nodes.
            over = run.status == "ended" or (run.status == "died" and not _may_outlive(record))
            if over and (record.ended or record.started) <= before and (opened := self.take(record.run)) is not None:
                opened.forget()
        # A process that is killed while it makes the plan leaves a lock and a key of the same age, but no record.
        for lock in self._runs.glob("*.lock"):
            with suppress(FileNotFoundError):
                unrecorded = lock.stat().st_mtime <= before.timestamp() and not lock.with_suffix(".json").exists()
                if unrecorded and (opened := self.take(lock.stem)) is not None:
                    opened.forget()


def _may_outlive(record: RunRecord) -> bool:
    """Whether nodes of a run may outlive its launcher; true also if its runtime cannot be used here."""
    if not record.runtime:
        return False
    runtime = find_runtime(record.runtime)
    return runtime is None or runtime.outlives_launcher


def _key(runs: Path, run: str) -> RunKey:
    return RunKey(runs / run / "key")


def _read_bytes(path: Path) -> bytes:
    """Contents of a file; none if it cannot be read."""
    try:
        return path.read_bytes()
    except OSError:
        return b""


def _read(path: Path) -> RunRecord:
    try:
        return _ADAPTER.validate_json(path.read_bytes())
    except FileNotFoundError as error:
        raise NotFoundError(f"no run {path.stem}", hint="throwcollect ps -a lists all") from error
    except OSError as error:
        raise unusable(path, error) from error
    except ValidationError as error:
        hint = f"{command('down', '--run', path.stem)} ends what is left of it, and forgets it"
        raise ConfigError(f"{path}: the record is damaged, or of another version of throwcollect", hint=hint) from error
