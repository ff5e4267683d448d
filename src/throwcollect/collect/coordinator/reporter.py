"""The interface by which a run reports its progress to a program or a terminal."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    # A command makes its reporter before it imports what takes long.
    from throwcollect.collect.coordinator.progress import Progress


class Reporter:
    """Receives reports on a run that this process prepares or launches; this class itself ignores all of them."""

    def update(self, progress: Progress) -> None:
        """Take in a progress report of the coordinator."""

    def say(self, line: str) -> None:
        """Take in a line of information; an error that is raised here ends a preparation."""

    def warn(self, line: str) -> None:
        """Take in a warning."""


SILENT = Reporter()
