"""The log files of a run's nodes, one for each node, which is never truncated.

A simulation announces in its log that it is ready for trials, because the log reaches the launcher in all cases: from a
process and from a container, with every middleware, and even if the launcher cannot join the ROS graph of the run.
`ready_line` is that announcement.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator
from pathlib import Path
from typing import TextIO

from throwcollect.own_process import ready_line

_TAIL_LINES = 40
_ORDER = {"launcher": 0, "router": 1, "coordinator": 2}
"""These nodes come first in lists; the simulations follow, sorted by number."""


class NodeLogs:
    """The log files in a directory, which need not exist yet."""

    def __init__(self, directory: Path) -> None:
        self._directory = directory
        self._earlier_bytes: dict[str, int] = {}

    def skip_earlier(self) -> None:
        """From now on, let `tail` and `said_ready` skip what is in the files: nodes of an earlier run printed it."""
        for name in self.files():
            self.skip(name)

    def skip(self, name: str) -> None:
        """Skip what a node has printed so far, too, because a new node of the same name may be started."""
        if (path := self.path(name)).is_file():
            self._earlier_bytes[name] = path.stat().st_size

    def path(self, name: str) -> Path:
        """Log file of a node."""
        return self._directory / f"{name}.log"

    def tail(self, name: str) -> str:
        """Last lines that a node printed."""
        try:
            with self._open(name) as log:
                return "".join(deque(log, _TAIL_LINES)).strip()
        except OSError:
            return ""

    def files(self) -> dict[str, Path]:
        """The existing log files by the names of their nodes: launcher, router, coordinator, then simulations."""
        paths = {path.stem: path for path in self._directory.glob("*.log")}
        # Names are sorted by their length first, so that sim_10 comes after sim_9.
        names = sorted(paths, key=lambda name: (_ORDER.get(name, len(_ORDER)), len(name), name))
        return {name: paths[name] for name in names}

    def said_ready(self, name: str) -> bool:
        """Whether a simulation has ever printed that it is ready for trials."""
        try:
            with self._open(name) as log:
                # `in` compares whole lines of the file, so a line that only quotes the announcement does not count.
                return f"{ready_line(name)}\n" in log
        except OSError:
            return False

    def _open(self, name: str) -> TextIO:
        """Open the log of a node, at the end of the part that is skipped."""
        log = self.path(name).open(encoding="utf-8", errors="replace")
        log.seek(self._earlier_bytes.get(name, 0))
        return log


class Tail:
    """Reads a growing file line by line; the file need not exist yet, and may move to another path meanwhile."""

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
