"""The launcher of a run: the process that drives the run's host, and the only one that changes the run's record."""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Sequence
from datetime import datetime, timezone
from typing import Any

from throwcollect.collect.coordinator.progress import Progress
from throwcollect.collect.coordinator.reporter import Reporter
from throwcollect.collect.runs.events import Event, append_events, compare_states
from throwcollect.collect.runs.run import Run
from throwcollect.collect.runtimes.nodes import NodeHost
from throwcollect.collect.runtimes.run_record import NodeState, RunFailure, RunRecord
from throwcollect.collect.runtimes.runtime import Host, RunEvent, get_runtime
from throwcollect.config.schema import Config
from throwcollect.dataset.lock import hold_lock
from throwcollect.dataset.summary import Info, explain_loss
from throwcollect.errors import ConfigError, Interrupted, LossError, ThrowcollectError
from throwcollect.wording import command

_WRITE_PROGRESS_S = 1.0
_ENDS: dict[int, RunEvent] = {0: "finished", LossError.exit_code: "finished", Interrupted.exit_code: "stopped"}


def launch(run: Run, interruptions: Callable[[], int], *, config: Config, reporter: Reporter) -> Info | None:
    """Launch a prepared run until its last trial has ended.

    A run that collects no dataset goes on until the user stops it. This function writes the end of the run into its
    record, and closes the run. `interruptions` returns how often the user has asked to stop: the first time, running
    trials are still finished.

    Returns:
        The summary of the dataset, whose outcomes show whether trials are lost; None if the run collects none.
    """

    def make_host(record: RunRecord) -> Host | NodeHost:
        return get_runtime(record.runtime).host(record, config, warn=reporter.warn)

    return launch_host(run, make_host, reporter=reporter, interruptions=interruptions)


def launch_host(
    run: Run,
    make_host: Callable[[RunRecord], Host | NodeHost],
    *,
    reporter: Reporter,
    interruptions: Callable[[], int],
) -> Info | None:
    """Let the host of a run do its work, and write the events and the end of the run; the rest is as for `launch`."""
    session = _Session(run, reporter, interruptions)
    record = run.record
    # If another error than a `ThrowcollectError` is raised, the record gets this one, so it always has an end.
    error: ThrowcollectError | None = ThrowcollectError("internal error")
    summary: Info | None = None
    host: Host | NodeHost | None = None
    try:
        record.middleware.joining.settle()
        host = make_host(record)
        with hold_lock(record.directory, alone=False):
            run.update(launcher=os.getpid())
            summary = _collect(host, session)
        error = None if summary is None else explain_loss(summary.outcomes, hint=record.resume_command)
        return summary
    except ThrowcollectError as raised:
        error = raised
        raise
    except KeyboardInterrupt:
        # In a Python program, Ctrl-C raises this wherever the program is.
        error = Interrupted("interrupted")
        raise
    finally:
        left = host is not None and not host.cleared
        if left:
            reporter.warn(f"containers of this run may be left: {command('down', '--run', run.id)} ends them")
        # The end is written into the record before the lock is released; otherwise the run would look dead in between.
        session.end(error, summary, left=left)
        run.close()


def _collect(host: Host | NodeHost, session: _Session) -> Info | None:
    if not isinstance(host, NodeHost):
        return host.collect(session)
    # This imports ROS, so it has to wait until the backend is chosen.
    from throwcollect.collect.runtimes.node_collection import NodeCollection

    return NodeCollection(host, session).run_to_the_end()


class _Session:
    """A `runtime.Session` that writes the record and the events of a run; the run goes on even if that fails."""

    def __init__(self, run: Run, reporter: Reporter, interruptions: Callable[[], int]) -> None:
        self.interruptions = interruptions
        self.reporter = reporter
        self._run = run
        self._states: list[NodeState] = []
        self._progress: Progress | None = None
        self._written_at = 0.0
        self._failed = False

    def update(self, progress: Progress) -> None:
        # The progress is written together with the next change of the nodes.
        self._progress = progress
        self.reporter.update(progress)

    def event(self, event: RunEvent, **details: Any) -> None:
        self._write([Event(run=self._run.id, event=event, **details)])
        if event == "stopping":
            self._write(stopping=True)

    def nodes(self, states: Sequence[NodeState], *, endpoint: str | None, simulations: int) -> None:
        before, self._states = self._states, list(states)
        progress = self._run.record.progress
        if time.monotonic() >= self._written_at + _WRITE_PROGRESS_S:
            self._written_at = time.monotonic()
            progress = self._progress or progress
        changes = {"nodes": tuple(states), "endpoint": endpoint, "simulations": simulations, "progress": progress}
        self._write(compare_states(self._run.id, before, states), **changes)

    def end(self, error: ThrowcollectError | None, summary: Info | None, *, left: bool) -> None:
        """Write the end of the run; `left` is whether its containers may still exist."""
        code, reason = (0, None) if error is None else (error.exit_code, str(error))
        self.event(_ENDS.get(code, "failed"), reason=reason, exit_code=code)
        self._write(
            nodes=tuple(self._states) if left else (),
            endpoint=None,
            progress=self._progress or self._run.record.progress,
            ended=datetime.now(timezone.utc),
            exit_code=code,
            failure=None if error is None else RunFailure.of(error),
            summary=summary,
            left=left,
        )

    def _write(self, events: Sequence[Event] = (), **changes: Any) -> None:
        """Append events, and change fields of the record."""
        try:
            append_events(self._run.record.logs, events)
            self._run.update(**changes)
        except (OSError, ConfigError) as error:
            if not self._failed:
                self._failed = True
                reason = error.message if isinstance(error, ConfigError) else str(error)
                self.reporter.warn(f"the record and the events of this run are no longer written: {reason}")
