"""Describes the state of a dataset that is not finished, and the command that goes on with it."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

from throwcollect.dataset.lock import is_locked
from throwcollect.wording import command


class NextCommand(NamedTuple):
    """The state of an unfinished dataset, such as ``is not finished``; a command to go on with, and what it does."""

    state: str
    command: str
    purpose: str


def find_next_command(directory: Path) -> NextCommand:
    """Find the state of an unfinished dataset; on file systems without locks, a run that works on it goes unnoticed."""
    if is_locked(directory):
        return NextCommand("is being collected", command("wait", "--run", directory), "waits for its end")
    return NextCommand("is not finished", command("resume", directory), "goes on with it")
