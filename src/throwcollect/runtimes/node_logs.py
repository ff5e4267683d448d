"""The log files of a run's nodes, one for each node, which is never truncated.

A simulation announces in its log that it is ready for trials, because the log reaches the launcher in all cases: from a
process, from a container on another machine, and with every middleware. `ready_line` is that announcement.
"""

from __future__ import annotations

import shutil
from collections import deque
from collections.abc import Iterator
from pathlib import Path
from typing import TextIO

from throwcollect.heartbeat import ready_line

_TAIL_LINES = 40
_FULL_BYTES = 64 * 1024
"""A disk with less free space counts as full: a write may have failed because it was larger than the free space."""
_ORDER = {"launcher": 0, "router": 1, "coordinator": 2}
"""These nodes come first in lists; the simulations follow, sorted by number."""


class NodeLogs:
    """The log files in a directory, which need not exist yet."""

    def __init__(self, directory: Path) -> None:
        self._directory = directory
        self._earlier_bytes: dict[str, int] = {}

    def skip_earlier(self) -> None:
        """Leave what is in the files by now out of `tail` and `said_ready`: nodes of an earlier run printed it."""
        for name in self.files():
            self.skip(name)

    def skip(self, name: str) -> None:
        """Leave what a node has printed so far out as well: another one of the same name may come."""
        if (path := self.path(name)).is_file():
            self._earlier_bytes[name] = path.stat().st_size

    def path(self, name: str) -> Path:
        """Log file of a node."""
        return self._directory / f"{name}.log"

    def tail(self, name: str) -> str:
        """Last lines that a node printed, and a remark if the disk is full, so that more may be missing."""
        try:
            with self._open(name) as log:
                lines = "".join(deque(log, _TAIL_LINES)).strip() + "\n"
            free = shutil.disk_usage(self._directory).free
        except OSError:
            return ""
        if free < _FULL_BYTES:
            lines += f"the disk of {self._directory} is full: {free} bytes are free; free space, and resume"
        return lines.strip()

    def files(self) -> dict[str, Path]:
        """The existing log files by the names of their nodes: launcher, router, coordinator, then simulations."""
        paths = {path.stem: path for path in self._directory.glob("*.log")}
        # The length of the name puts sim_10 behind sim_9.
        names = sorted(paths, key=lambda name: (_ORDER.get(name, len(_ORDER)), len(name), name))
        return {name: paths[name] for name in names}

    def said_ready(self, name: str) -> bool:
        """Whether a simulation has ever printed that it is ready for trials."""
        try:
            with self._open(name) as log:
                # A file is a sequence of its lines, so only a whole line counts, and not a quotation of it.
                return f"{ready_line(name)}\n" in log
        except OSError:
            return False

    def _open(self, name: str) -> TextIO:
        """Open the log of a node behind what is left out."""
        log = self.path(name).open(encoding="utf-8", errors="replace")
        log.seek(self._earlier_bytes.get(name, 0))
        return log


class Tail:
    """Reads a file that grows, and need not exist yet, line by line; it may move to another path meanwhile."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self._offset = 0

    def skip(self) -> None:
        """Skip everything that is in the file already."""
        if self.path.exists():
            self._offset = self.path.stat().st_size

    def lines(self, *, torn: bool = False) -> Iterator[str]:
        """Read the lines that were added since the last call, without line ends.

        A last line without a line end is read only if `torn` is true.
        """
        try:
            file = self.path.open("rb")
        except FileNotFoundError:
            return
        with file:
            file.seek(self._offset)
            for line in file:
                # The node is still writing this line. The offset stays before it, so the next call reads all of it.
                if not line.endswith(b"\n") and not torn:
                    return
                self._offset += len(line)
                yield line.decode(errors="replace").rstrip("\n")
