"""An reporter that keeps the lines that it receives."""

from __future__ import annotations

from throwcollect.collect.coordinator.reporter import Reporter


class Listener(Reporter):
    """Keeps lines of information, and warnings."""

    def __init__(self) -> None:
        self.said: list[str] = []
        self.warnings: list[str] = []

    def say(self, line: str) -> None:
        self.said.append(line)

    def warn(self, line: str) -> None:
        self.warnings.append(line)
