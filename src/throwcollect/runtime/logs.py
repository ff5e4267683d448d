"""What the nodes of a run print, as it lies in its directory of logs."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

_ORDER = {"launcher": 0, "router": 1, "coordinator": 2}
"""Before the simulations, which follow by number."""


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


def log_files(logs: Path) -> dict[str, Path]:
    """The logs by the name of their node: launcher, router, coordinator, then simulations."""
    found = {path.stem: path for path in logs.glob("*.log")}

    def place(name: str) -> tuple[int, int, str]:
        return _ORDER.get(name, len(_ORDER)), len(name), name

    return {name: found[name] for name in sorted(found, key=place)}
