"""The records of this machine's runs, each with a lock that the launcher of the run holds as long as it lives.

The files lie in a directory of the user and not in datasets, so that a dataset does not depend on who read it::

    runs/<run>.json     the record; each change writes the whole file
    runs/<run>.lock     locked by the launcher, see `state_directory.is_locked`
    runs/<run>/key/     the key of the run, with which every process can join that can read it
    runs/<run>/         further files of a run without a dataset, or before its plan is made

Only the owner can read these files.
"""

from __future__ import annotations

import fcntl
import os
import secrets
import time
from contextlib import ExitStack, suppress
from datetime import datetime, timedelta, timezone
from pathlib import Path

from throwcollect.collect.runs.run import Run
from throwcollect.errors import ConfigError, ConflictError
from throwcollect.state_directory import state_directory, unusable

_REMEMBERED = timedelta(days=7)
"""Records of runs that have ended are kept for this long."""
_LOCK_PATIENCE_S = 1.0
"""`Records.take` tries for this long, because another process may hold the lock for a moment in `is_locked`."""


class Records:
    """All runs of this user on this machine."""

    def __init__(self) -> None:
        self._runs = state_directory() / "runs"
        try:
            self._runs.mkdir(mode=0o700, exist_ok=True)
            # If the user has named the directory above, others may be allowed to read it, but not the records.
            self._runs.chmod(0o700)
        except OSError as error:
            raise unusable(self._runs, error) from error

    def new(self, name: str, *, run: str | None = None) -> Run:
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
            made = Run(self._runs, chosen, lock=lock)
            with ExitStack() as undo:
                undo.callback(made.forget)
                try:
                    # This waits only for `is_locked` of another process, which may have the new lock for a moment.
                    fcntl.flock(lock, fcntl.LOCK_EX)
                    made.files.mkdir(mode=0o700, exist_ok=True)
                except OSError as error:
                    raise unusable(made.files, error) from error
                made.key.create()
                undo.pop_all()
            return made

    def open(self, run: str, *, lock: int = -1) -> Run:
        """A run, whose record may be damaged; `lock` is the descriptor of the locked file of one that is taken over."""
        return Run(self._runs, run, lock=lock)

    def take(self, run: str) -> Run | None:
        """Open a run whose launcher is dead, so that this process can forget it; None if the launcher lives."""
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
                        return Run(self._runs, run, lock=lock)
            if time.monotonic() > deadline:
                return None
            time.sleep(0.01)

    def ids(self) -> list[str]:
        """Sorted ids of all runs that have a record, even a damaged one."""
        return sorted(path.stem for path in self._runs.glob("*.json"))

    def get(self, run: str) -> Run:
        """Read a run."""
        return Run(self._runs, run).now()

    def all(self) -> list[Run]:
        """All runs whose records can be read, the latest last."""
        runs = []
        for run in self.ids():
            with suppress(ConfigError):
                runs.append(self.get(run))
        return sorted(runs, key=lambda run: run.record.started)

    def into(self, directory: Path) -> list[Run]:
        """Runs that collect, or have collected, into a directory; the latest last."""
        name = Path(os.path.realpath(directory))
        return [run for run in self.all() if run.record.directory == name]

    def read_change_ns(self, run: str) -> int | None:
        """Time of the last change of a run's record, in ns of the file system's clock; None without a record."""
        try:
            return (self._runs / f"{run}.json").stat().st_mtime_ns
        except OSError:
            return None

    def _forget_old(self) -> None:
        before = datetime.now(timezone.utc) - _REMEMBERED
        for run in self.all():
            record = run.record
            # The record of a run whose nodes may outlive its launcher is kept: nothing else describes these nodes.
            over = run.status == "ended" or (run.status == "died" and not run.may_outlive_launcher)
            if over and (record.ended or record.started) <= before and (opened := self.take(run.id)) is not None:
                opened.forget()
        # A process that is killed while it makes the plan leaves a lock and a key of the same age, but no record.
        for lock in self._runs.glob("*.lock"):
            with suppress(FileNotFoundError):
                unrecorded = lock.stat().st_mtime <= before.timestamp() and not lock.with_suffix(".json").exists()
                if unrecorded and (opened := self.take(lock.stem)) is not None:
                    opened.forget()
