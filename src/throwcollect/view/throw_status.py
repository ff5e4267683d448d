"""What the table of throws says of the throw that is shown."""

from __future__ import annotations

from typing import Any

from rclzenoh.interfaces import get_message
from throwcollect.units import NS_PER_S
from throwcollect.view.viewed import ViewedThrow

NAME = "throw"
HARDWARE = "throwcollect"
"""Hardware of the status; by it and `NAME` a viewer chooses what it shows."""


def throw_facts(throw: ViewedThrow) -> Any:
    """The row of a throw in the table of throws, without the columns that are null.

    Args:
        throw: The throw.

    Returns:
        A diagnostic_msgs/DiagnosticArray with one status: OK if the trial succeeded, else a warning.
    """
    row = throw.row
    status, pair = (get_message(f"diagnostic_msgs/msg/{name}") for name in ("DiagnosticStatus", "KeyValue"))
    sec, nanosec = divmod(throw.start_ns, NS_PER_S)
    stamp = get_message("builtin_interfaces/msg/Time")(sec=sec, nanosec=nanosec)
    shown = status(
        level=status.OK if row["outcome"] == throw.config.task.success else status.WARN,
        name=NAME,
        hardware_id=HARDWARE,
        message=": ".join(part for part in (f"trial {row['trial']} {row['outcome']}", row["reason"]) if part),
        values=[pair(key=key, value=_text(value)) for key, value in row.items() if value is not None],
    )
    header = get_message("std_msgs/msg/Header")(stamp=stamp)
    return get_message("diagnostic_msgs/msg/DiagnosticArray")(header=header, status=[shown])


def _text(value: object) -> str:
    return f"{value:.6g}" if isinstance(value, float) else str(value)
