"""Ends and scales a run from another process than its launcher."""

from __future__ import annotations

import os
import signal
import time
from collections.abc import Callable, Iterable, Sequence
from contextlib import suppress
from typing import TYPE_CHECKING

from throwcollect.collect.runs.records import Records
from throwcollect.collect.runs.run import Run
from throwcollect.collect.runs.run_selection import require_living, require_simulations
from throwcollect.collect.runtimes.nodes import LAUNCHER, SIMULATIONS
from throwcollect.collect.runtimes.runtime import find_runtime, get_runtime
from throwcollect.errors import (
    ConfigError,
    ConflictError,
    ThrowcollectError,
    UnreachableError,
    WorkerError,
)
from throwcollect.members import names_of
from throwcollect.wording import command

if TYPE_CHECKING:
    from throwcollect.ros.msg import SetParametersResult

_POLL_S = 0.05
_STOP_S = 60.0
"""A launcher needs less to drain the run and to end all nodes."""
_GRACE_S = 3.0
_FORCE_S = 10.0
_ANSWER_S = 10.0
"""Time for the router to answer, and then for the nodes: the router may be restarting, the launcher ending nodes."""


def stop(run: Run, *, keep_on: Callable[[], bool] = lambda: True) -> Run:
    """Drain a run: running trials are finished and written, no further trial is started, and all nodes end.

    This function waits until the run ends or `keep_on` returns false, and returns the run as it is then.
    """
    require_living(run)
    _signal(run, signal.SIGTERM)
    deadline = time.monotonic() + _STOP_S
    while run.is_locked() and keep_on():
        if time.monotonic() > deadline:
            raise WorkerError(
                f"run {run.id} has not ended within {_STOP_S:g} s",
                hint=f"{command('down', '--run', run.id)} ends it by force",
            )
        time.sleep(_POLL_S)
    return run.now()


def down(run: Run) -> list[str]:
    """End all nodes of a run, by force if need be, and forget the run; a dataset in a directory stays.

    Returns:
        Names of the containers and networks that were removed.
    """
    runtimes: Iterable[str] = names_of("runtimes")
    evidence = None
    # A run whose record is damaged can be removed, too, but without the record its launcher's process id is unknown.
    with suppress(ConfigError):
        record = run.now().record
        runtimes, evidence = (record.runtime,), f"its pid is {record.launcher}"
        _end_launcher(run)
    taken = Records().take(run.id)
    if taken is None:
        raise WorkerError(f"run {run.id}: its launcher does not end", evidence=evidence)
    try:
        # A runtime that cannot be used here holds nothing.
        removed = [name for each in filter(None, map(find_runtime, runtimes)) for name in each.remove(run.id)]
    except ThrowcollectError:
        # The record stays, so that the command can be repeated.
        taken.close()
        raise
    taken.forget()
    return removed


def scale(run: Run, simulations: int) -> None:
    """Ask the launcher of a run for another number of simulations."""
    # The run may have ended since it was found.
    run = run.now()
    record = require_living(run)
    require_simulations(run)
    if record.runtime and not get_runtime(record.runtime).can_be_scaled:
        raise ConfigError(f"run {run.id}: has one simulation, as all runs of the runtime {record.runtime} have")
    (result,) = set_parameter(run, [f"/{LAUNCHER}"], SIMULATIONS, simulations)
    if not result.successful:
        raise ConfigError(f"run {run.id}: {result.reason}")


def set_parameter(run: Run, nodes: Sequence[str], name: str, value: float | str) -> list[SetParametersResult]:
    """Set a parameter of several nodes of a run at the same time, and return the answer of each node.

    `nodes` are full names, with their namespaces.
    """
    if (connection := run.connection) is None:
        raise ConflictError(f"run {run.id}: is still starting", hint="try again in a moment")
    connection.middleware.joining.settle()
    from throwcollect.collect.runtimes.run_listener import call_nodes
    from throwcollect.ros import Parameter
    from throwcollect.ros.srv import SetParameters

    request = SetParameters.Request(parameters=[Parameter(name, value=value).to_parameter_msg()])
    try:
        responses = call_nodes(connection, nodes, SetParameters, "set_parameters", request, patience_s=_ANSWER_S)
    except UnreachableError as error:
        hint = "throwcollect events shows what became of its nodes"
        raise WorkerError(f"run {run.id}: {error.message}", hint=hint) from error
    return [response.results[0] for response in responses]


def _end_launcher(run: Run) -> None:
    """End a launcher, and with it its processes: ask it to drain, then to end at once, then kill it."""
    for number, patience_s in ((signal.SIGTERM, _GRACE_S), (signal.SIGTERM, _FORCE_S), (signal.SIGKILL, _FORCE_S)):
        _signal(run, number)
        deadline = time.monotonic() + patience_s
        while run.is_locked() and time.monotonic() < deadline:
            time.sleep(_POLL_S)


def _signal(run: Run, number: signal.Signals) -> None:
    """Send a signal to a launcher, but never to another process to which its process id was given later."""
    with suppress(ProcessLookupError):
        # The descriptor is opened before the lock is checked: if the run still lives then, it is the launcher's.
        process = os.pidfd_open(run.record.launcher)
        try:
            if run.is_locked():
                signal.pidfd_send_signal(process, number)
        finally:
            os.close(process)
