"""Who is told what goes on in a run."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    # Whoever looks on is there before anything that takes long to import.
    from throwcollect.coordinator.progress import Progress


class Onlooker:
    """Is told what goes on in a run that this process prepares or launches; this one heeds nothing of it."""

    def update(self, progress: Progress) -> None:
        """Take in a progress report of the coordinator."""

    def say(self, line: str) -> None:
        """Take in what is good to know."""

    def warn(self, line: str) -> None:
        """Take in what went wrong."""


SILENT = Onlooker()
