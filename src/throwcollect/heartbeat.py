"""Signs of life of a node that need no ROS: a line in its log when it is ready, and a file that shows that it runs.

The loop of a node touches the file, and the health check of its container looks at the time of the file, which costs
nearly nothing; a file that is older than 5 s means that the node is stuck. To ask the node itself, a process would have
to join the graph, every few seconds in every container.
The image names the file; outside of containers there is none.
"""

from __future__ import annotations

import os
import time
from pathlib import Path

VARIABLE = "THROWCOLLECT_HEARTBEAT"
"""Name of the environment variable that names the file."""
_PERIOD_S = 1.0


def ready_line(name: str) -> str:
    """Write the line in the log of a simulation that says that its node is ready for trials."""
    return f"{name} is ready"


class Heartbeat:
    """Touches the file that the environment names, if it names one."""

    def __init__(self) -> None:
        named = os.environ.get(VARIABLE)
        self._path = Path(named) if named else None
        self._due = 0.0

    def beat(self) -> None:
        """Touch the file, at most once a second, so that the loop may call this each time."""
        # Unlike the time of day, this clock cannot be set back; after that, no beat would be due for a long time.
        now = time.monotonic()
        if self._path is not None and now >= self._due:
            self._due = now + _PERIOD_S
            self._path.touch()
