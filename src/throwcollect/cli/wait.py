"""`throwcollect wait`: a run followed from any terminal."""

from __future__ import annotations

from functools import partial
from pathlib import Path

import typer

from throwcollect.cli.interruptions import Interruptions
from throwcollect.cli.summary import print_summary
from throwcollect.cli.terminal import display
from throwcollect.errors import Interrupted
from throwcollect.runtime.events import EVENTS, parse
from throwcollect.runtime.logs import Tail
from throwcollect.runtime.records import Records
from throwcollect.runtime.runs import died, failure, to_watch
from throwcollect.wording import command


def wait_for(named: str | None, *, json: bool) -> None:
    """Show the progress of a run until it ends, and then its summary.

    Raises:
        ThrowcollectError: What the run ended with.
        ConfigError: If there is no such run.
        WorkerError: If its launcher died.
        Interrupted: If the user leaves; the run goes on.
        OutputError: If the summary cannot be printed.
    """
    records = Records()
    run = to_watch(records, named, say=partial(typer.echo, err=True))
    run.record.middleware.joining.settle()
    from throwcollect.runtime.run_listener import follow

    events = Tail(Path(run.record.logs) / EVENTS)
    events.skip()
    with display(quiet=json) as shown, Interruptions() as interruptions:
        looks = follow(records, run.record.run, on_progress=shown.update, keep_on=lambda: not interruptions.count)
        for look in looks:
            run = look
            for event in filter(None, map(parse, events.lines())):
                if event.alarming:
                    shown.warn(str(event))
    record = run.record
    if run.status == "running":
        raise Interrupted(f"left; run {record.run} goes on", hint=command("wait", "--run", record.run))
    if run.status == "died":
        raise died(record)
    error = failure(record)
    if record.summary is not None:
        print_summary(record.summary, None if record.volume else Path(record.directory), as_json=json)
    if error is not None:
        raise error
