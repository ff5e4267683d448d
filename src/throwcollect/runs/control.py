"""Ends and scales a run from another process than its launcher."""

from __future__ import annotations

import os
import signal
import time
from collections.abc import Callable, Sequence
from contextlib import suppress
from typing import TYPE_CHECKING

from throwcollect.errors import ConfigError, ConflictError, ThrowcollectError, WorkerError
from throwcollect.files import StrPath
from throwcollect.ros.router_endpoint import answers
from throwcollect.runs.records import Records, Run
from throwcollect.runs.run_record import RunRecord
from throwcollect.runs.run_selection import (
    find_held_runs,
    id_of,
    require_living,
    require_simulations,
)
from throwcollect.runtimes.nodes import LAUNCHER
from throwcollect.runtimes.registry import get_runtime
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
    _signal(run.records, require_living(run), signal.SIGTERM)
    deadline = time.monotonic() + _STOP_S
    while run.records.lives(run.id) and keep_on():
        if time.monotonic() > deadline:
            raise WorkerError(
                f"run {run.id} has not ended within {_STOP_S:g} s",
                hint=f"{command('down', '--run', run.id)} ends it by force",
            )
        time.sleep(_POLL_S)
    return run.now()


def down(named: StrPath | Run, *, volumes: bool = False) -> tuple[str, list[str]]:
    """End all nodes of a run, by force if need be, and forget the run; a dataset in a directory stays.

    `named` is a run, or a name that `find` accepts, or the id of a run without a record whose containers a runtime
    still holds. A volume that holds the dataset is removed only if `volumes` is true.

    Returns:
        Id of the run, and names of the containers, networks and volumes that were removed.
    """
    records, held = Records(), find_held_runs()
    if isinstance(named, Run):
        run = named.id
    elif isinstance(named, str) and named in held:
        run = named
    else:
        run = id_of(records, named)
    record: RunRecord | None = None
    # A run whose record is damaged can be removed, too, but without the record its launcher's process id is unknown.
    with suppress(ConfigError):
        record = records.get(run).record
    if record is not None:
        _end_launcher(records, record)
    taken = records.take(run)
    if taken is None:
        evidence = None if record is None else f"its pid is {record.launcher}"
        raise WorkerError(f"run {run}: its launcher does not end", evidence=evidence)
    runtime = held[run][0] if run in held else ""
    if record is not None:
        runtime = record.runtime
    try:
        removed = get_runtime(runtime).remove(run, volumes=volumes) if runtime else []
    except ThrowcollectError:
        # The record stays, so that the command can be repeated.
        taken.close()
        raise
    taken.forget()
    return run, removed


def scale(run: Run, simulations: int) -> None:
    """Ask the launcher of a run for another number of simulations."""
    # The run may have ended since it was found.
    run = run.now()
    record = require_living(run)
    require_simulations(run)
    if record.runtime and not get_runtime(record.runtime).can_be_scaled:
        raise ConfigError(f"run {run.id}: has one simulation, as all runs of the runtime {record.runtime} have")
    if record.endpoint is None:
        raise ConflictError(f"run {run.id}: is still starting", hint="try again in a moment")
    record.middleware.joining.settle()
    from throwcollect.runtimes.node_collection import SIMULATIONS

    (result,) = set_parameter(run, [f"/{LAUNCHER}"], SIMULATIONS, simulations)
    if not result.successful:
        raise ConfigError(f"run {run.id}: {result.reason}")


def set_parameter(run: Run, nodes: Sequence[str], name: str, value: float | str) -> list[SetParametersResult]:
    """Set a parameter of several nodes of a run at the same time, and return the answer of each node.

    `nodes` are full names, with their namespaces.
    """
    connection = run.connection
    if connection is None or not answers(connection.endpoint, patience_s=_ANSWER_S):
        raise _silent(run, nodes[0])
    connection.middleware.joining.settle()
    from throwcollect.ros import Parameter
    from throwcollect.ros.srv import SetParameters
    from throwcollect.runtimes.run_listener import take_part

    with take_part(connection) as (asking, executor):
        request = SetParameters.Request(parameters=[Parameter(name, value=value).to_parameter_msg()])
        futures = []
        for node in nodes:
            client = asking.create_client(SetParameters, f"{node}/set_parameters")
            # A request that is sent before the service is found is lost.
            if not client.wait_for_service(_ANSWER_S):
                raise _silent(run, node)
            futures.append(client.call_async(request))
        deadline = time.monotonic() + _ANSWER_S
        for node, future in zip(nodes, futures, strict=True):
            executor.spin_until_future_complete(future, timeout_sec=max(0.0, deadline - time.monotonic()))
            if not future.done():
                raise _silent(run, node)
        return [future.result().results[0] for future in futures]


def _silent(run: Run, node: str) -> WorkerError:
    endpoint = run.record.endpoint
    who = "its launcher" if node == f"/{LAUNCHER}" else node
    return WorkerError(
        f"run {run.id}: {who} does not answer" + (f" over the router at {endpoint}" if endpoint else ""),
        hint="throwcollect events tells what became of its nodes",
    )


def _end_launcher(records: Records, record: RunRecord) -> None:
    """End a launcher, and with it its processes: ask it to drain, then to end at once, then kill it."""
    for number, patience_s in ((signal.SIGTERM, _GRACE_S), (signal.SIGTERM, _FORCE_S), (signal.SIGKILL, _FORCE_S)):
        _signal(records, record, number)
        deadline = time.monotonic() + patience_s
        while records.lives(record.run) and time.monotonic() < deadline:
            time.sleep(_POLL_S)


def _signal(records: Records, record: RunRecord, number: signal.Signals) -> None:
    """Send a signal to a launcher, but never to another process to which its process id was given later."""
    with suppress(ProcessLookupError):
        # The descriptor is opened before `lives` is called: if the run still lives then, it is the launcher's.
        process = os.pidfd_open(record.launcher)
        try:
            if records.lives(record.run):
                signal.pidfd_send_signal(process, number)
        finally:
            os.close(process)
