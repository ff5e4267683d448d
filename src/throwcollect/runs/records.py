"""What this machine remembers of its runs: one JSON file each, and a lock that its launcher holds as long as it lives.

The files lie in a directory of the user, not in datasets, so that a dataset does not depend on who looked at it::

    runs/<run>.json     the record, written whole at each change
    runs/<run>.lock     locked by the launcher: neither a pid that is used again nor a crash can feign a living one
    runs/<run>/key/     the key of the run: whoever can read it may join
    runs/<run>/         besides, files of a run whose dataset has no directory on this machine

All of it is for its owner alone.
"""

from __future__ import annotations

import fcntl
import json
import os
import secrets
import shutil
import time
from collections.abc import Iterable, Iterator
from contextlib import ExitStack, suppress
from dataclasses import dataclass, field, replace
from datetime import datetime, timezone
from pathlib import Path
from typing import Any, Literal

from pydantic import TypeAdapter, ValidationError
from pydantic_core import to_json

from throwcollect.errors import ConfigError, ConflictError, NotFoundError
from throwcollect.files import beside, write_all
from throwcollect.ros.connection import Connection
from throwcollect.run_key import RunKey
from throwcollect.runs.lock_file import is_locked
from throwcollect.runs.record import VERSION, Record
from throwcollect.runs.state_directory import state_directory, unusable
from throwcollect.runtimes.registry import get_runtime
from throwcollect.runtimes.runtime import Place
from throwcollect.units import NS_PER_S
from throwcollect.wording import command

_REMEMBERED_S = 7 * 24 * 3600.0
"""Ended runs are remembered for this long."""
_LOCK_PATIENCE_S = 1.0
"""Whoever asks whether a launcher lives holds its lock for a moment."""


@dataclass(frozen=True)
class Run:
    """A run, as others than its launcher see it.

    Attributes:
        record: What is known of it.
        lives: Whether its launcher lives.
        key: What its router lets nobody in without.
        records: Where it is remembered, for whoever wants to look again.
    """

    record: Record
    lives: bool
    key: RunKey
    records: Records = field(repr=False, compare=False)

    @property
    def id(self) -> str:
        """Its id."""
        return self.record.run

    def now(self) -> Run:
        """The run, as it is by now.

        Raises:
            ConfigError: If its record has vanished, or cannot be read.
        """
        return self.records.get(self.id)

    @property
    def place(self) -> Place:
        """Where it lies."""
        return self.record.place(self.key)

    @property
    def connection(self) -> Connection | None:
        """The way into its ROS graph; None while it has no router."""
        record = self.record
        if record.endpoint is None:
            return None
        return Connection(record.endpoint, self.key, record.domain_id, record.middleware)

    @property
    def status(self) -> Literal["running", "ended", "abandoned", "died"]:
        """Whether it runs, has ended, ended with containers left behind, or lost its launcher before it could."""
        if self.record.ended is not None:
            return "abandoned" if self.record.left else "ended"
        return "running" if self.lives else "died"


_ADAPTER = TypeAdapter(Record)


class OpenRun:
    """A run that this process launches: its lock is held until `close`, or until the process dies.

    Attributes:
        run: Id of the run.
        directory: Directory of the key, and for files of a run whose dataset has no directory on this machine.
        key: What its router lets nobody in without.

    Args:
        runs: Directory of the records.
        run: Id of the run.
        lock: Descriptor of the locked file.
    """

    def __init__(self, runs: Path, run: str, lock: int) -> None:
        self.run = run
        self.directory = runs / run
        self.key = _key(runs, run)
        self._runs = runs
        self._lock = lock
        self._record: Record | None = None

    @property
    def lock(self) -> int:
        """Descriptor of the locked file, for a process that takes the run over."""
        return self._lock

    @property
    def record(self) -> Record:
        """The record.

        Raises:
            ConfigError: If there is none yet, or it is damaged.
        """
        if self._record is None:
            self._record = _read(self._runs / f"{self.run}.json")
        return self._record

    def make(self) -> None:
        """Make the directory, and the key in it.

        Raises:
            ConfigError: If they cannot be written.
        """
        try:
            self.directory.mkdir(mode=0o700, exist_ok=True)
        except OSError as error:
            raise unusable(self.directory, error) from error
        self.key.create()

    def write(self, record: Record) -> None:
        """Write the record.

        Raises:
            ConfigError: If it cannot be written.
        """
        self._record = record
        path = self._runs / f"{self.run}.json"
        try:
            with beside(path, mode=0o600) as descriptor:
                write_all(descriptor, _ADAPTER.dump_json(record, indent=1))
        except OSError as error:
            raise unusable(path, error) from error

    def update(self, **changes: Any) -> None:
        """Change fields of the record, if they are not so already.

        Raises:
            ConfigError: If it cannot be written.
        """
        changed = replace(self.record, **changes)
        if changed != self.record:
            self.write(changed)

    def close(self) -> None:
        """Let go of the run; the record stays."""
        if self._lock >= 0:
            os.close(self._lock)
            self._lock = -1

    def forget(self) -> None:
        """Remove the record and the files of the run, but no dataset in a directory, and let go of it."""
        for path in (self._runs / f"{self.run}.json", self._runs / f"{self.run}.lock"):
            with suppress(OSError):
                path.unlink()
        shutil.rmtree(self.directory, ignore_errors=True)
        self.close()


class Records:
    """All runs that the user has on this machine.

    Raises:
        ConfigError: If the directory cannot be used.
    """

    def __init__(self) -> None:
        state = state_directory()
        self._runs = state / "runs"
        try:
            self._runs.mkdir(mode=0o700, exist_ok=True)
            # Whoever may read in the directory above, which the user has named, shall see nothing of what is in here.
            self._runs.chmod(0o700)
        except OSError as error:
            raise unusable(self._runs, error) from error

    def new(self, name: str, *, run: str | None = None) -> OpenRun:
        """A new run, with a key but without a record yet; forgets what ended a week ago.

        Args:
            name: Name of the collection; part of the id.
            run: Its id; None for one that nobody has.

        Raises:
            ConflictError: If there is a run of that id.
            ConfigError: If it cannot be written.
        """
        self._forget_old()
        wanted = run
        while True:
            run = wanted or f"{name}-{secrets.token_hex(2)}"
            try:
                lock = os.open(self._runs / f"{run}.lock", os.O_RDWR | os.O_CREAT | os.O_EXCL, 0o600)
            except FileExistsError as error:
                if wanted:
                    raise ConflictError(f"there is a run {run} already") from error
                continue
            except OSError as error:
                raise unusable(self._runs / f"{run}.lock", error) from error
            fcntl.flock(lock, fcntl.LOCK_EX)
            made = OpenRun(self._runs, run, lock)
            with ExitStack() as undo:
                undo.callback(made.forget)
                made.make()
                undo.pop_all()
            return made

    def inherit(self, run: str, lock: int) -> OpenRun:
        """The run that the starter of this process has handed over, with its locked descriptor."""
        return OpenRun(self._runs, run, lock)

    def take(self, run: str) -> OpenRun | None:
        """The run, whose launcher is dead, to be launched or forgotten by this process; None if that lives.

        Raises:
            ConfigError: If its lock cannot be opened.
        """
        try:
            lock = os.open(self._runs / f"{run}.lock", os.O_RDWR | os.O_CREAT, 0o600)
        except OSError as error:
            raise unusable(self._runs / f"{run}.lock", error) from error
        deadline = time.monotonic() + _LOCK_PATIENCE_S
        while True:
            try:
                fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except BlockingIOError:
                if time.monotonic() > deadline:
                    os.close(lock)
                    return None
                time.sleep(0.01)
            else:
                return OpenRun(self._runs, run, lock)

    def ids(self) -> list[str]:
        """Ids of all runs that have a record, damaged or not; sorted."""
        return sorted(path.stem for path in self._runs.glob("*.json"))

    def get(self, run: str) -> Run:
        """A run.

        Raises:
            NotFoundError: If it has no record.
            ConfigError: If that is damaged or of another version.
        """
        # The lock first: a launcher that ends in between has written its end before it lets go.
        lives = self.lives(run)
        return Run(_read(self._runs / f"{run}.json"), lives, _key(self._runs, run), self)

    def all(self) -> list[Run]:
        """All runs whose records can be read, the latest last."""
        return sorted(self._read_all(self.ids()), key=lambda each: each.record.started)

    def into(self, directory: Path) -> list[Run]:
        """Runs that collect, or have collected, into a directory and no volume; the latest last.

        There may be thousands of records, so those that do not name the directory are not taken apart.
        """
        name = str(directory.absolute())
        written = to_json(name)
        runs = self._read_all(run for run in self.ids() if written in _read_bytes(self._runs / f"{run}.json"))
        chosen = (run for run in runs if run.record.volume is None and run.record.directory == name)
        return sorted(chosen, key=lambda each: each.record.started)

    def _read_all(self, runs: Iterable[str]) -> Iterator[Run]:
        for run in runs:
            with suppress(ConfigError):
                yield self.get(run)

    def read_change_ns(self, run: str) -> int | None:
        """When the record of a run was written last, in nanoseconds of the file system's clock; None if it is gone."""
        try:
            return (self._runs / f"{run}.json").stat().st_mtime_ns
        except OSError:
            return None

    def _age_s(self, run: str) -> float:
        """Time since the record of a run was written [s]; 0 if it is gone."""
        changed_ns = self.read_change_ns(run)
        return 0.0 if changed_ns is None else time.time() - changed_ns / NS_PER_S

    def lives(self, run: str) -> bool:
        """Whether the launcher of a run lives."""
        return is_locked(self._runs / f"{run}.lock")

    def _forget_old(self) -> None:
        now = datetime.now(timezone.utc)
        # A record that was written since is not old, whatever it says, and need not be read.
        old = [name for name in self.ids() if self._age_s(name) >= _REMEMBERED_S]
        for each in self._read_all(old):
            record = each.record
            # Where nodes outlive their launcher, this record tells what they are as long as they do.
            over = each.status == "ended" or (each.status == "died" and not _outlived(record))
            if over and (now - (record.ended or record.started)).total_seconds() >= _REMEMBERED_S:
                run = self.take(record.run)
                if run is not None:
                    run.forget()


def _outlived(record: Record) -> bool:
    """Whether nodes of a run may be there whose launcher is not; so it is, if nobody knows its runtime here."""
    try:
        return bool(record.runtime) and get_runtime(record.runtime).outlives_launcher
    except ConfigError:
        return True


def _key(runs: Path, run: str) -> RunKey:
    return RunKey(runs / run / "key")


def _read_bytes(path: Path) -> bytes:
    """Contents of a file; none if it cannot be read."""
    try:
        return path.read_bytes()
    except OSError:
        return b""


def _read(path: Path) -> Record:
    hint = f"{command('down', '--run', path.stem)} ends what is left of it, and forgets it"
    try:
        content = json.loads(path.read_bytes())
        version = content.get("version") if isinstance(content, dict) else None
        if version not in (None, VERSION):
            raise ConfigError(f"{path}: the record of the run is of another version of throwcollect", hint=hint)
        if isinstance(content, dict) and (message := content.get("message")):
            # Earlier records have all facts of the error in one text.
            content["failure"] = {"message": message}
        return _ADAPTER.validate_python(content)
    except FileNotFoundError as error:
        raise NotFoundError(f"no run {path.stem}", hint="throwcollect ps -a lists all") from error
    except OSError as error:
        raise unusable(path, error) from error
    except (ValueError, ValidationError) as error:
        raise ConfigError(f"{path}: the record of the run is damaged", hint=hint) from error
