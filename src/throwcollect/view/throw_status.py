"""The row of the table of throws as a message, for the throw that is shown."""

from __future__ import annotations

from typing import Any

from rclzenoh.interfaces import get_message
from throwcollect.episode.topics import make_header
from throwcollect.view.shown_throws import ShownThrow

NAME = "throw"
HARDWARE = "throwcollect"
"""Hardware id of the status; a layout names the status for a panel by this and `NAME`."""


def throw_facts(throw: ShownThrow) -> Any:
    """A diagnostic_msgs/DiagnosticArray with the row of a throw, without columns that are null.

    Its only status is OK if the trial succeeded, else a warning.
    """
    row = throw.row
    status, pair = (get_message(f"diagnostic_msgs/msg/{name}") for name in ("DiagnosticStatus", "KeyValue"))
    shown = status(
        level=status.OK if row["outcome"] == throw.config.task.success else status.WARN,
        name=NAME,
        hardware_id=HARDWARE,
        message=": ".join(part for part in (f"trial {row['trial']} {row['outcome']}", row["reason"]) if part),
        values=[pair(key=key, value=_write_text(value)) for key, value in row.items() if value is not None],
    )
    header = make_header("", throw.start_ns)
    return get_message("diagnostic_msgs/msg/DiagnosticArray")(header=header, status=[shown])


def _write_text(value: object) -> str:
    return f"{value:.6g}" if isinstance(value, float) else str(value)
