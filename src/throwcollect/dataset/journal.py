"""The journal of a dataset, ``logs/journal.jsonl``: what happened while it was collected, in that order.

Each line is a JSON object with `event`, `time` (Unix [s]) and the facts of that event. Lines are only ever appended,
also after an interruption. The journal is for people and for the data card.
"""

from __future__ import annotations

import json
import os
import time
from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal, TypeGuard, get_args

from throwcollect.dataset.directory import JOURNAL
from throwcollect.dataset.lock import lock
from throwcollect.files import open_log, unreadable, unwritable, write_all

Event = Literal["opened", "exposed", "recovered", "lease", "commit", "fail", "lost", "shard", "finished"]
"""
- ``opened``: a process began to collect into the directory: `pid`.
- ``exposed``: any process that reaches the router may join, because of `run.open` or because nothing protects it.
- ``recovered``: the episodes that earlier processes had left were taken in: `episodes`.
- ``lease``: a trial was given to a simulation: `trial`, `simulation`.
- ``commit``: the episode of a trial was written: `trial`, `outcome`, `digest`, and the columns that the task aims at.
- ``fail``: a simulation did not hand over the episode of a trial: `trial`, `simulation`, `reason`.
- ``lost``: no simulation did, and the trial was given up: `trial`, `reason`.
- ``shard``: a file was finished: `name`.
- ``finished``: the dataset was finished: `wall_s`, the real time that it took in all [s], as the data card has it.
"""


class Journal:
    """The journal of a dataset that is being collected, which one process at a time may hold."""

    def __init__(self, directory: Path) -> None:
        self._path = directory / JOURNAL
        try:
            self._descriptor = open_log(self._path, os.O_RDWR | os.O_CREAT | os.O_APPEND)
        except OSError as error:
            raise unwritable(self._path, error) from error
        try:
            lock(self._descriptor, directory)
            self._earlier_s = measure_collected_s(directory) or 0.0
            self._opened_s = time.monotonic()
            size = os.fstat(self._descriptor).st_size
            if size and os.pread(self._descriptor, 1, size - 1) != b"\n":
                # The process that wrote last was killed while it wrote a line.
                self._append(b"\n")
            self.note("opened", pid=os.getpid())
        except BaseException:
            # The lock would last as long as this process otherwise.
            os.close(self._descriptor)
            raise

    def measure_collected_s(self) -> float:
        """Add up the real time for which this process and earlier ones have collected [s], to the millisecond."""
        # Unlike the time of day, this clock cannot be set meanwhile.
        return round(self._earlier_s + time.monotonic() - self._opened_s, 3)

    def note(self, event: Event, **details: Any) -> None:
        """Append an event."""
        self._append(json.dumps({"event": event, "time": round(time.time(), 3), **details}).encode() + b"\n")

    def close(self) -> None:
        """Close the file, so that another process can hold it."""
        os.close(self._descriptor)

    def _append(self, data: bytes) -> None:
        try:
            write_all(self._descriptor, data)
        except OSError as error:
            raise unwritable(self._path, error) from error


@dataclass(frozen=True)
class JournalLine:
    """One line of a journal; `wall_s` (real time that collecting took in all) and `outcome` are None in most lines."""

    event: Event
    time_s: float
    wall_s: float | None = None
    outcome: str | None = None


def read_journal(path: Path) -> Iterator[JournalLine]:
    """Read the events of a journal, in order; a missing file has none, and damaged lines are left out."""
    for entry in _read_lines(path):
        time_s, wall_s, outcome = (entry.get(name) for name in ("time", "wall_s", "outcome"))
        known = entry.get("event") in get_args(Event) and isinstance(outcome, str | None)
        if known and _is_time(time_s) and (wall_s is None or _is_time(wall_s)):
            yield JournalLine(entry["event"], time_s, wall_s, outcome)


def _is_time(value: object) -> TypeGuard[float]:
    """Whether a value is a time [s] before the year 5138, and not NaN or an integer that no float holds."""
    return isinstance(value, int | float) and 0 <= value < 1e11


def _read_lines(path: Path, mark: bytes = b"") -> Iterator[dict[str, Any]]:
    """Read the fields of the lines that hold `mark`: there are several lines for each trial, and parsing takes long."""
    try:
        descriptor = open_log(path, os.O_RDONLY)
    except OSError:
        return
    with open(descriptor, "rb") as file:
        yield from (_parse(line) for line in file if mark in line)


def read_commits(
    path: Path, columns: Sequence[str], *, first: int, most_bytes: int
) -> tuple[list[list[Any]], int, bool]:
    """Read the trials whose episodes were written from a part of a journal; one that was collected again occurs again.

    Args:
        path: The file; if it is missing, it has no trials.
        columns: Values to read of each trial: `trial`, `outcome`, and numbers; None where there is none.
        first: Where the part begins [bytes]: 0, or where an earlier part has ended.
        most_bytes: Largest size of the part, which is more than that of a line.

    Returns:
        The values of `columns` of each trial, where the part ended, and whether there is more.
    """
    try:
        with open(open_log(path, os.O_RDONLY), "rb") as file:
            file.seek(first)
            data = file.read(most_bytes)
            # One byte more shows whether another part follows.
            rest = file.read(1)
    except FileNotFoundError:
        return [], first, False
    except OSError as error:
        raise unreadable(path, error) from error
    # Another process may be writing the last line now.
    whole = data[: data.rfind(b"\n") + 1]
    entries = [_parse(line) for line in whole.splitlines() if b'"commit"' in line]
    found = [
        [value if isinstance(value := entry.get(name), int | float | str) else None for name in columns]
        for entry in entries
    ]
    return found, first + len(whole), bool(rest)


def _parse(line: bytes) -> dict[str, Any]:
    """Read the fields of a line; none if it was cut off or damaged."""
    with suppress(ValueError, RecursionError):
        entry = json.loads(line)
        if isinstance(entry, dict):
            return entry
    return {}


def was_open(directory: Path) -> bool:
    """Whether any process that reached the router could join one of the collections into a dataset."""
    return any(entry.get("event") == "exposed" for entry in _read_lines(directory / JOURNAL, b'"exposed"'))


def measure_collected_s(directory: Path) -> float | None:
    """Add up the real time for which processes have collected into a dataset [s]; None if no journal has it.

    The process that finishes a dataset writes this time down. Processes that came after it count from their first to
    their last event, and so do all if none has finished the dataset.
    """
    total: float | None = None
    last = 0.0
    for entry in read_journal(directory / JOURNAL):
        if entry.event == "opened":
            total = total or 0.0
        elif entry.event == "finished" and entry.wall_s is not None:
            total = entry.wall_s
        elif total is not None:
            # If the clock was set back between two events, no time counts between them.
            total += max(entry.time_s - last, 0.0)
        last = entry.time_s
    return total
