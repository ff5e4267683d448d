"""Begins runs in processes of their own, which also make the plan, so that a client does not have to wait for it.

Such a run has a record from its first moment. If its preparation fails, the error is written into that record, too.
"""

from __future__ import annotations

import os
import shutil
import signal
from collections.abc import Callable, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, replace
from datetime import datetime, timezone
from functools import partial
from pathlib import Path

from pydantic import TypeAdapter

from throwcollect.collect.coordinator.reporter import Reporter
from throwcollect.collect.runs.component_container import DESCRIPTION, check_request, launch_container
from throwcollect.collect.runs.launcher import launch
from throwcollect.collect.runs.preparation import add_runtime, prepare, resume
from throwcollect.collect.runs.records import Records
from throwcollect.collect.runs.run import Run
from throwcollect.collect.runtimes.node_logs import NodeLogs
from throwcollect.collect.runtimes.nodes import LAUNCHER
from throwcollect.collect.runtimes.run_record import Kind, Origin, RunFailure, RunRecord
from throwcollect.collect.runtimes.runtime import choose
from throwcollect.config.loader import load, load_locating_errors
from throwcollect.config.run import ContainerSpec
from throwcollect.config.values import with_values
from throwcollect.dataset.carried_robot import write_config
from throwcollect.dataset.directory import config_path
from throwcollect.errors import Interrupted, ThrowcollectError, WorkerError
from throwcollect.files import open_log
from throwcollect.own_process import stop_signals
from throwcollect.ros.router_endpoint import reserve_port
from throwcollect.side_by_side import count_cores


@dataclass(frozen=True)
class Order:
    """What `begin_run` sends to the new process: its arguments, with absolute paths."""

    config: Path
    overrides: tuple[str, ...]
    output: Path
    resumed: bool = False


_ORDERS = TypeAdapter(Order)
_SPECS = TypeAdapter(ContainerSpec)


def begin_run(
    config: Path,
    *,
    overrides: Sequence[str],
    output: Path,
    run: str | None = None,
    origin: Origin | None = None,
    kind: Kind = "collection",
    resumed: bool = False,
) -> Run:
    """Begin a run in a process of its own, which outlives this one; return as soon as the run has a record.

    Args:
        config: The configuration's file.
        overrides: Keys to change: ``key=value`` pairs, as ``--set`` takes them.
        output: Directory of the dataset, new or empty unless it is resumed; a session makes it when clients record.
        run: Id of the run; None makes a new one.
        origin: The request of a client; None if no client asks.
        kind: Kind of the run.
        resumed: Whether the run continues the dataset that the directory holds.
    """
    read = load(config, overrides)
    made = Records().new(read.name, run=run)
    directory = made.files / "data" if kind == "session" else output
    record = made.begin(read.name, directory, kind=kind, origin=origin, domain_id=read.run.domain_id)
    record = replace(record, simulations=read.run.simulations)
    order = Order(config.absolute(), tuple(overrides), output.absolute(), resumed)
    return _begin(made, record, _ORDERS.dump_json(order))


def begin_container(spec: ContainerSpec, *, run: str, origin: Origin, urdf: Path | None) -> Run:
    """Begin a run that is a container of the catalogue, in a process of its own, as `begin_run` does.

    `urdf` is a file with a description of the robot for viewers; None if the component has none.
    """
    check_request(spec, origin)
    made = Records().new(origin.component, run=run)
    directory = made.files / "data"

    def lay_out() -> None:
        directory.mkdir()
        if urdf is not None:
            shutil.copyfile(urdf, directory / DESCRIPTION)

    record = made.begin(origin.component, directory, runtime="docker", kind="container", origin=origin)
    return _begin(made, record, _SPECS.dump_json(spec), lay_out)


def _begin(run: Run, record: RunRecord, order: bytes, lay_out: Callable[[], None] = lambda: None) -> Run:
    """Hand the run over to a process of its own; `lay_out` makes further files."""
    try:
        record.logs.mkdir(exist_ok=True)
        lay_out()
        run.hand_over(record, order)
    except BaseException as error:
        run.forget()
        if isinstance(error, OSError):
            raise WorkerError(f"run {run.id} cannot be begun: {error}") from error
        raise
    return run.now()


def carry_out(id: str, lock: int, order: bytes, *, reporter: Reporter, interruptions: Callable[[], int]) -> None:
    """Launch a run in the process that `Run.hand_over` has started, and prepare it before, if there is an order.

    This process has inherited the locked file. Signals that ask it to stop may be blocked until it calls this function;
    from now on, `interruptions` counts them.
    """
    signal.pthread_sigmask(signal.SIG_UNBLOCK, stop_signals())
    run = Records().open(id, lock=lock)
    if not order:
        launch(run, interruptions, config=load(config_path(run.record.directory)), reporter=reporter)
        return
    if run.record.kind == "container":
        launch_container(run, _SPECS.validate_json(order), reporter=reporter, interruptions=interruptions)
        return
    log = NodeLogs(run.record.logs).path(LAUNCHER)

    def end_if_asked() -> None:
        if interruptions():
            raise Interrupted("stopped before any node was started")

    # If anything fails before the launch, the error is written into the record, and then the files of the run are
    # removed.
    with ExitStack() as made:
        try:
            if _prepare(run, _ORDERS.validate_json(order), _Planner(reporter, end_if_asked)) is None:
                run.update(ended=datetime.now(timezone.utc), exit_code=0)
                run.close()
                return
            made.enter_context(run)
            _move_log(log, NodeLogs(run.record.logs).path(LAUNCHER))
            # The last steps of the preparation do not check for a request to stop, and may have taken long.
            end_if_asked()
        except ThrowcollectError as error:
            run.update(ended=datetime.now(timezone.utc), exit_code=error.exit_code, failure=RunFailure.of(error))
            raise
        run.collect(interruptions=interruptions)


class _Planner(Reporter):
    """Passes what the preparation reports on, and ends it on a request to stop."""

    def __init__(self, reporter: Reporter, end_if_asked: Callable[[], None]) -> None:
        self._reporter = reporter
        self._end_if_asked = end_if_asked

    def say(self, line: str) -> None:
        self._end_if_asked()
        self._reporter.say(line)

    def warn(self, line: str) -> None:
        self._reporter.warn(line)


def _move_log(before: Path, after: Path) -> None:
    """Move the launcher's log to the logs of the nodes, whose directory exists by now, and print into it."""
    try:
        # If this process prints somewhere else, such as into a terminal, there is no log to move.
        if before == after or not os.path.samestat(os.fstat(1), before.stat()):
            return
        after.parent.mkdir(exist_ok=True)
        with open(open_log(after), "ab") as log:
            log.write(before.read_bytes())
            log.flush()
            for output in (1, 2):
                os.dup2(log.fileno(), output)
        before.unlink()
    except OSError as error:
        raise WorkerError(f"{after}: the launcher cannot write there: {error.strerror}") from error


def _prepare(run: Run, order: Order, reporter: Reporter) -> Run | None:
    """Prepare a run; None if nothing is left to do."""
    if run.record.kind == "session":
        return _prepare_session(run, order, reporter)
    cores = count_cores()
    if order.resumed:
        return resume(order.output, overrides=order.overrides, processes=cores, reporter=reporter, run=run)
    return prepare(
        order.config, overrides=order.overrides, output=order.output, processes=cores, reporter=reporter, run=run
    )


def _prepare_session(run: Run, order: Order, reporter: Reporter) -> Run:
    with load_locating_errors(order.config, order.overrides) as read:
        # Clients of a session act in real time. The file has the factor, as nodes and watchers take it from there.
        config = with_values(read, {"sim.real_time_factor": read.sim.real_time_factor or 1.0})
        directory = run.record.directory
        directory.mkdir(exist_ok=True)
        write_config(directory, config)
        reserve_port(config.run).close()
        choice = choose(config, reporter)
        # Containers do not see the directory.
        record = replace(run.record, recordings=str(order.output) if choice[0] == "local" else None)
        run.write(add_runtime(record, config, *choice, reporter=reporter))
        launching = partial(launch, config=config, reporter=reporter)
        return run.prepared(config, directory, launching, held=ExitStack(), undo=ExitStack())
