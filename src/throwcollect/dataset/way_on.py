"""Says how it stands with a dataset that is not finished, and what gets further."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from throwcollect.dataset.lock import is_locked
from throwcollect.wording import command


@dataclass(frozen=True)
class WayOn:
    """How it stands with an unfinished dataset.

    Attributes:
        state: What it is or is not, in words.
        command: The command that gets further.
        purpose: What that command does.
    """

    state: str
    command: str
    purpose: str


def find_way_on(directory: Path) -> WayOn:
    """Find out how it stands with an unfinished dataset; where there are no locks, it counts as left by its run."""
    if is_locked(directory):
        return WayOn("is being collected", command("wait", "--run", directory), "waits for its end")
    return WayOn("is not finished", command("resume", directory), "goes on with it")
