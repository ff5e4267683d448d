"""The events of a run: one JSON document a line in ``events.jsonl`` next to the logs."""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass, field
from datetime import datetime, timezone
from pathlib import Path
from typing import Literal

from throwcollect.collect.runtimes.run_record import NodeState
from throwcollect.files import open_log
from throwcollect.wording import format_count

EVENTS = "events.jsonl"

NodeEvent = Literal["started", "ready", "lost", "restarting", "given up", "frozen", "continued", "removed"]

_ALARMING = ("lost", "given up", "frozen")


@dataclass(frozen=True, kw_only=True)
class Event:
    """An event of a run, or of one of its nodes.

    Attributes:
        time: Time of the event, in the form of RFC 3339.
        event: Kind of the event: a `RunEvent`, or a `NodeEvent` if there is a node.
        handle: Process or container id of a node that was started.
        reason: Why a node or the run ended, in words.
        simulations: Number of simulations that the run is to have from now on.
        exit_code: Exit code of a run that has ended.
    """

    time: str = field(default_factory=lambda: datetime.now(timezone.utc).isoformat(timespec="milliseconds"))
    run: str
    event: str
    node: str | None = None
    handle: str | None = None
    reason: str | None = None
    simulations: int | None = None
    exit_code: int | None = None

    @property
    def alarming(self) -> bool:
        """Whether a terminal that follows the run should show the event: a node was lost or is frozen."""
        return self.node is not None and self.event in _ALARMING

    def to_json(self) -> str:
        """Write the event as a line of its file, without the fields that it lacks."""
        return json.dumps({key: value for key, value in asdict(self).items() if value is not None})

    def __str__(self) -> str:
        """The event in words, for people."""
        details = [self.reason.partition("\n")[0] if self.reason else None]
        details += [format_count(self.simulations, "simulation") if self.simulations is not None else None]
        details += [f"exit code {self.exit_code}" if self.exit_code else None, self.handle and self.handle[:12]]
        text = ", ".join(filter(None, details))
        return f"{self.node or self.run} {self.event}" + (f": {text}" if text else "")


def append_events(logs: Path, events: Sequence[Event]) -> None:
    """Append events to the file in a directory of logs, which is made if need be."""
    if events:
        with open(open_log(logs / EVENTS), "a", encoding="utf-8") as file:
            file.write("".join(f"{event.to_json()}\n" for event in events))


def compare_states(run: str, before: Sequence[NodeState], after: Sequence[NodeState]) -> list[Event]:
    """Make an event of a run for each difference between two lists of states of its nodes."""
    known = {state.name: state for state in before}
    events = [
        Event(run=run, event=event, node=state.name, handle=handle, reason=reason)
        for state in after
        for event, handle, reason in _find_changes(known.pop(state.name, None), state)
    ]
    return events + [Event(run=run, event="removed", node=name) for name in known]


def parse(line: str) -> Event | None:
    """Read an event from a line; None if the line is incomplete."""
    try:
        return Event(**json.loads(line))
    except (ValueError, TypeError):
        return None


def _find_changes(old: NodeState | None, new: NodeState) -> Iterator[tuple[NodeEvent, str | None, str | None]]:
    """Compare two states of a node: event, handle and reason of each change."""
    old = old or NodeState(new.name, "starting", 0, None, None)
    # A node may have ended and started again between two looks, so ends are seen by the number of restarts.
    if new.restarts > old.restarts or (new.status == "lost" and old.status != "lost"):
        yield "lost", None, new.last_end
        yield "given up" if new.status == "lost" else "restarting", None, None
    if new.handle is not None and new.handle != old.handle:
        yield "started", new.handle, None
    if new.status == "frozen" and old.status != "frozen":
        yield "frozen", None, None
    # Router and coordinator count as running as soon as they have a handle, so that they have no event `ready`.
    if new.status == "running" and new.handle == old.handle and old.status in ("starting", "frozen"):
        yield "ready" if old.status == "starting" else "continued", None, None
