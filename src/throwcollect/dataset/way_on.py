"""Describes the state of a dataset that is not finished, and the command that goes on with it."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from throwcollect.dataset.lock import is_locked
from throwcollect.wording import command


@dataclass(frozen=True)
class WayOn:
    """The state of an unfinished dataset, and the way to a finished one.

    Attributes:
        state: Predicate of a sentence about the dataset, such as ``is not finished``.
        command: The command that leads to a finished dataset.
        purpose: What that command does.
    """

    state: str
    command: str
    purpose: str


def find_way_on(directory: Path) -> WayOn:
    """Find the state of an unfinished dataset; on a file system without locks, no run is known to work on it."""
    if is_locked(directory):
        return WayOn("is being collected", command("wait", "--run", directory), "waits for its end")
    return WayOn("is not finished", command("resume", directory), "goes on with it")
