"""The log files of a run's nodes, one each, to which all that a node ever printed is appended.

A simulation announces in its log that it is ready for trials, because the log is the one thing that reaches whoever
started it from everywhere: from a process, from a container on another machine, and whatever carries ROS messages. The
announcement is written by `ready_line`, for the node as for whoever looks for it.
"""

from __future__ import annotations

import shutil
from collections import deque
from collections.abc import Iterator
from pathlib import Path

from throwcollect.heartbeat import ready_line

_TAIL_LINES = 40
_FULL_BYTES = 64 * 1024
"""With less than this a disk counts as full: what could not be written may have been larger than what is free."""
_ORDER = {"launcher": 0, "router": 1, "coordinator": 2}
"""Before the simulations, which follow by number."""


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

    def files(self) -> dict[str, Path]:
        """The logs that there are by the name of their node: launcher, router, coordinator, then simulations."""
        found = {path.stem: path for path in self._directory.glob("*.log")}
        names = sorted(found, key=lambda name: (_ORDER.get(name, len(_ORDER)), len(name), name))
        return {name: found[name] for name in names}

    def said_ready(self, name: str) -> bool:
        """Whether a simulation has ever printed that it is ready for trials."""
        try:
            with self.path(name).open(encoding="utf-8", errors="replace") as log:
                return f"{ready_line(name)}\n" in log
        except OSError:
            return False


class Tail:
    """Reads a file that grows, line by line.

    Args:
        path: The file; need not exist yet.
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        self._offset = 0

    def skip(self) -> None:
        """Leave out everything that is there already."""
        if self._path.exists():
            self._offset = self._path.stat().st_size

    def lines(self, *, torn: bool = False) -> Iterator[str]:
        """Lines that have come since the last call, without their ends.

        Args:
            torn: Whether a last line without an end is given out, too.
        """
        try:
            file = self._path.open("rb")
        except FileNotFoundError:
            return
        with file:
            file.seek(self._offset)
            for line in file:
                if not line.endswith(b"\n") and not torn:
                    return
                self._offset += len(line)
                yield line.decode(errors="replace").rstrip("\n")
