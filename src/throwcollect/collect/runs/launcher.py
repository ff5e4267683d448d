"""The launcher of a run: the process that drives the run's host, and the only one that changes the run's record."""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Sequence
from datetime import datetime, timezone
from typing import Any

from throwcollect.collect.coordinator.progress import Progress
from throwcollect.collect.coordinator.reporter import Reporter
from throwcollect.collect.runs.events import EventLog
from throwcollect.collect.runs.run import Run
from throwcollect.collect.runtimes.run_record import NodeState, RunFailure, RunRecord
from throwcollect.collect.runtimes.runtime import Host, RunEvent, get_runtime
from throwcollect.config.schema import Config
from throwcollect.dataset.lock import hold_lock
from throwcollect.dataset.summary import Info, explain_loss
from throwcollect.errors import ConfigError, Interrupted, LossError, ThrowcollectError
from throwcollect.wording import command

_WRITE_PROGRESS_S = 1.0


def launch(run: Run, interruptions: Callable[[], int], *, config: Config, reporter: Reporter) -> Info | None:
    """Launch a prepared run until its last trial has ended.

    A run that collects no dataset goes on until the user stops it. This function writes the end of the run into its
    record, and closes the run. `interruptions` returns how often the user has asked to stop: the first time, running
    trials are still finished.

    Returns:
        The summary of the dataset, whose outcomes show whether trials are lost; None if the run collects none.
    """

    def host(record: RunRecord) -> Host:
        run.record.middleware.joining.settle()
        return get_runtime(run.record.runtime).host(record, config, warn=reporter.warn)

    return launch_host(run, host, reporter=reporter, interruptions=interruptions)


def launch_host(
    run: Run,
    make_host: Callable[[RunRecord], Host],
    *,
    reporter: Reporter,
    interruptions: Callable[[], int],
) -> Info | None:
    """Let the host of a run do its work, and write the events and the end of the run; the rest is as for `launch`."""
    session = _Session(run, reporter, interruptions)
    record = run.record
    # If another error than a `ThrowcollectError` is raised, the record gets these values, so it always has an end.
    code, summary = 1, None
    failure: RunFailure | None = RunFailure("internal error")
    host: Host | None = None
    try:
        host = make_host(record)
        with hold_lock(record.directory, alone=False):
            run.update(launcher=os.getpid())
            summary = host.collect(session)
        lost = None if summary is None else explain_loss(summary.outcomes, hint=record.resume_command)
        code, failure = (0, None) if lost is None else (lost.exit_code, RunFailure.of(lost))
        return summary
    except ThrowcollectError as error:
        code, failure = error.exit_code, RunFailure.of(error)
        raise
    except KeyboardInterrupt:
        # In a Python program, Ctrl-C raises this wherever the program is.
        code, failure = Interrupted.exit_code, RunFailure("interrupted")
        raise
    finally:
        left = host is not None and not host.cleared
        if left:
            reporter.warn(f"containers of this run may be left: {command('down', '--run', run.id)} ends them")
        # The end is written into the record before the lock is released; otherwise the run would look dead in between.
        session.end(code, failure, summary, left=left)
        run.close()


class _Session:
    """A `runtime.Session` that writes the record and the events of a run; the run goes on even if that fails."""

    def __init__(self, run: Run, reporter: Reporter, interruptions: Callable[[], int]) -> None:
        self.interruptions = interruptions
        self.say = reporter.say
        self.warn = reporter.warn
        self._run = run
        self._onlooker = reporter
        self._events = EventLog(run.record.logs, run.id)
        self._states: list[NodeState] = []
        self._progress: Progress | None = None
        self._written_at = 0.0
        self._failed = False

    def update(self, progress: Progress) -> None:
        # The progress is written together with the next change of the nodes.
        self._progress = progress
        self._onlooker.update(progress)

    def event(self, event: RunEvent, **details: Any) -> None:
        self._write(lambda: self._events.run_event(event, **details))
        if event == "stopping":
            self._write(lambda: self._run.update(stopping=True))

    def nodes(self, states: Sequence[NodeState], *, endpoint: str | None, simulations: int) -> None:
        if states != self._states:
            before, self._states = self._states, list(states)
            self._write(lambda: self._events.node_events(before, states))
        progress = self._run.record.progress
        if time.monotonic() >= self._written_at + _WRITE_PROGRESS_S:
            self._written_at = time.monotonic()
            progress = self._progress or progress
        self._write(
            lambda: self._run.update(nodes=tuple(states), endpoint=endpoint, simulations=simulations, progress=progress)
        )

    def end(self, code: int, failure: RunFailure | None, summary: Info | None, *, left: bool) -> None:
        """Write the end of the run; `left` is whether its containers may still exist."""
        event: RunEvent = "failed"
        if code in (0, LossError.exit_code):
            event = "finished"
        elif code == Interrupted.exit_code:
            event = "stopped"
        self.event(event, reason=failure and str(failure.error(code)), exit_code=code)
        self._write(
            lambda: self._run.update(
                nodes=tuple(self._states) if left else (),
                endpoint=None,
                progress=self._progress or self._run.record.progress,
                ended=datetime.now(timezone.utc),
                exit_code=code,
                failure=failure,
                summary=summary,
                left=left,
            )
        )

    def _write(self, write: Callable[[], None]) -> None:
        try:
            write()
        except (OSError, ConfigError) as error:
            if not self._failed:
                self._failed = True
                reason = error.message if isinstance(error, ConfigError) else str(error)
                self._onlooker.warn(f"the record and the events of this run are no longer written: {reason}")
