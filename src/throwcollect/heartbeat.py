"""What a node shows of its state without ROS: that it is ready, as a line in its log, and that its loop goes on.

The sign of life is a file that the loop of a node touches, and a health check looks at. Nodes on Fast DDS have it: to
join them takes a second of processor time, too much for a check that is made often. The image names the file; outside
of containers there is none.
"""

from __future__ import annotations

import os
import time
from pathlib import Path

VARIABLE = "THROWCOLLECT_HEARTBEAT"
"""Names the file."""
SILENT_S = 5.0
"""A node that has not touched its file for so long is stuck: its loop goes round several times a second."""
_PERIOD_S = 1.0


def ready_line(name: str) -> str:
    """The line by which a simulation announces in its log that it is ready for trials.

    Args:
        name: Name of its node.
    """
    return f"{name} is ready"


class Heartbeat:
    """Touches the file that the environment names, if it names one."""

    def __init__(self) -> None:
        named = os.environ.get(VARIABLE)
        self._path = Path(named) if named else None
        self._due = 0.0

    def beat(self) -> None:
        """Say that the loop goes on; call it as often as you like."""
        now = time.monotonic()
        if self._path is not None and now >= self._due:
            self._due = now + _PERIOD_S
            self._path.touch()


def is_beating() -> bool:
    """Whether the node of this container has touched its file of late."""
    try:
        return time.time() - Path(os.environ[VARIABLE]).stat().st_mtime < SILENT_S
    except (KeyError, OSError):
        return False
