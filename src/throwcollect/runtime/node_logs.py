"""The log files of a run's nodes, one each, to which all that a node ever printed is appended."""

from __future__ import annotations

import shutil
from collections import deque
from pathlib import Path

_TAIL_LINES = 40
_FULL_BYTES = 64 * 1024
"""With less than this a disk counts as full: what could not be written may have been larger than what is free."""


class NodeLogs:
    """The directory of the log files; it need not exist yet.

    Args:
        directory: Its path.
    """

    def __init__(self, directory: Path) -> None:
        self._directory = directory

    def path(self, name: str) -> Path:
        """File of a node."""
        return self._directory / f"{name}.log"

    def tail(self, name: str) -> str:
        """Last lines that a node printed and, if it may have failed to print more, that the disk is full."""
        try:
            with self.path(name).open(encoding="utf-8", errors="replace") as log:
                said = "".join(deque(log, _TAIL_LINES)).strip() + "\n"
            free = shutil.disk_usage(self._directory).free
        except OSError:
            return ""
        if free < _FULL_BYTES:
            said += f"the disk of {self._directory} is full: {free} bytes are free; free space, and resume"
        return said.strip()

    def said_ready(self, name: str) -> bool:
        """Whether a simulation has ever printed that it is ready for trials."""
        try:
            with self.path(name).open(encoding="utf-8", errors="replace") as log:
                return f"{name} is ready\n" in log
        except OSError:
            return False
