"""Runs that begin in a process of their own: it makes the plan, too, so whoever asks for one need not wait for that.

Such a run has a record from its first moment. Whatever its preparation fails of is written there, as all else is.
"""

from __future__ import annotations

import os
import shutil
import signal
import subprocess
import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from datetime import datetime, timezone
from pathlib import Path
from typing import IO, Literal, cast

from pydantic import TypeAdapter

from throwcollect.config.loader import dump_yaml, load, load_locating_errors
from throwcollect.config.schema import Config
from throwcollect.dataset.directory import config_path
from throwcollect.errors import ConfigError, Interrupted, Problem, ThrowcollectError, WorkerError
from throwcollect.files import open_log, write_file
from throwcollect.interruption import stop_signals
from throwcollect.runs.choice import choose
from throwcollect.runs.component_container import (
    CONTAINER_ORDERS,
    DESCRIPTION,
    ContainerOrder,
    check_order,
    launch_container,
)
from throwcollect.runs.onlooker import Onlooker
from throwcollect.runs.preparation import Request, prepare_run, resume
from throwcollect.runs.prepared_run import PreparedRun
from throwcollect.runs.record import Failure, Kind, Origin, Record
from throwcollect.runs.records import OpenRun, Records, Run
from throwcollect.runtimes.node_logs import NodeLogs
from throwcollect.runtimes.nodes import LAUNCHER
from throwcollect.runtimes.registry import get_runtime
from throwcollect.side_by_side import count_cores


@dataclass(frozen=True)
class Order:
    """What a run is to be made from.

    Attributes:
        config: Absolute path of the configuration's file.
        overrides: What replaces keys of it: ``key=value`` pairs, as ``--set`` takes them.
        output: Absolute path of the dataset's directory; unused by a run that collects none.
        resumed: Whether that holds a dataset, with which the run goes on.
    """

    config: Path
    overrides: tuple[str, ...]
    output: Path
    resumed: bool = False


_ORDERS = TypeAdapter(Order)


def begin_run(
    config: Path,
    *,
    overrides: Sequence[str],
    output: Path,
    run: str | None = None,
    origin: Origin | None = None,
    kind: Literal["collection", "session"] = "collection",
    resumed: bool = False,
) -> Run:
    """Begin a run in a process of its own, which outlives this one; come back as soon as the run has a record.

    Args:
        config: The configuration's file.
        overrides: What replaces keys of it: ``key=value`` pairs, as ``--set`` takes them.
        output: Directory of the dataset, new or empty unless it is resumed; unused by a run that collects none.
        run: Id of the run; None for one that nobody has.
        origin: What was asked for; None if no client did.
        kind: Whether it collects a dataset, or has simulations for clients alone.
        resumed: Whether the directory holds a dataset, with which the run goes on.

    Raises:
        ConflictError: If there is a run of that id.
        ConfigError: If the configuration cannot be used.
        WorkerError: If the process cannot be started.
    """
    read = load(config, overrides)
    if kind == "session":
        _check_session(read)
    opened = Records().new(read.name, run=run)
    record = _new_record(
        opened,
        name=read.name,
        directory=opened.directory / "data" if kind == "session" else output.absolute(),
        domain_id=read.run.domain_id,
        simulations=read.run.simulations,
        kind=kind,
        origin=origin,
    )
    order = Order(config.absolute(), tuple(overrides), output.absolute(), resumed)
    return _begin(opened, record, _ORDERS.dump_json(order))


def begin_container(order: ContainerOrder, *, run: str, origin: Origin, urdf: Path | None) -> Run:
    """Begin a run that is a container of the catalogue, in a process of its own, as `begin_run` does.

    Args:
        order: What it is to be made from.
        run: Id of the run.
        origin: What was asked for.
        urdf: File of a description of the robot that viewers are told; None for none.

    Raises:
        ConflictError: If there is a run of that id, or the one that it is to join has ended.
        ConfigError: If something is not there that the catalogue asks for, or it cannot join that run.
        WorkerError: If no engine answers, it does not have the image, or the process cannot be started.
    """
    check_order(order)
    opened = Records().new(order.component, run=run)
    directory = opened.directory / "data"
    record = _new_record(
        opened, name=order.component, directory=directory, domain_id=0, simulations=0, kind="container", origin=origin
    )

    def lay_out() -> None:
        directory.mkdir()
        if urdf is not None:
            shutil.copyfile(urdf, directory / DESCRIPTION)

    return _begin(opened, replace(record, runtime="docker"), CONTAINER_ORDERS.dump_json(order), lay_out)


def _new_record(
    opened: OpenRun,
    *,
    name: str,
    directory: Path,
    domain_id: int,
    simulations: int,
    kind: Kind,
    origin: Origin | None,
) -> Record:
    return Record(
        run=opened.run,
        name=name,
        runtime="",
        directory=str(directory),
        volume=None,
        # What happens before there is a directory of the dataset, which has to be empty until then.
        logs=str(opened.directory / "logs"),
        domain_id=domain_id,
        started=datetime.now(timezone.utc),
        launcher=0,
        simulations=simulations,
        begun_in=os.getcwd(),
        kind=kind,
        origin=origin,
    )


def _begin(opened: OpenRun, record: Record, order: bytes, lay_out: Callable[[], None] = lambda: None) -> Run:
    """Start the process of a run, and write the record.

    Args:
        opened: The run.
        record: Its record, without that process.
        order: What the process is told.
        lay_out: Makes files of the run.

    Raises:
        ConfigError: If the record cannot be written.
        WorkerError: If the process cannot be started.
    """
    process: subprocess.Popen[bytes] | None = None
    try:
        logs = Path(record.logs)
        logs.mkdir(exist_ok=True)
        lay_out()
        process = _start_process(opened, logs)
        opened.write(replace(record, launcher=process.pid))
        # It waits for this, so that the record is there before it changes it.
        with cast(IO[bytes], process.stdin) as pipe:
            pipe.write(order)
    except (ThrowcollectError, OSError) as error:
        if process is not None:
            process.kill()
            process.wait()
        opened.forget()
        if isinstance(error, OSError):
            raise WorkerError(f"run {opened.run} cannot be begun: {error}") from error
        raise
    opened.close()
    return Records().get(opened.run)


def _start_process(run: OpenRun, logs: Path) -> subprocess.Popen[bytes]:
    words = [sys.executable, "-m", "throwcollect", "begin", run.run, "--lock", str(run.lock)]
    # Until it can heed a signal that asks it to stop, which takes it a second, the signal waits.
    before = signal.pthread_sigmask(signal.SIG_BLOCK, stop_signals())
    try:
        with open(open_log(NodeLogs(logs).path(LAUNCHER)), "ab") as log:
            return subprocess.Popen(
                words,
                stdin=subprocess.PIPE,
                stdout=log,
                stderr=subprocess.STDOUT,
                start_new_session=True,
                pass_fds=[run.lock],
            )
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def carry_out(run: str, lock: int, order: bytes, *, onlooker: Onlooker, interruptions: Callable[[], int]) -> None:
    """Prepare and launch a run in the process that `begin_run` has started.

    Args:
        run: Id of the run.
        lock: Descriptor of its locked file, which this process has inherited.
        order: What it is to be made from.
        onlooker: Is told what goes on.
        interruptions: How often somebody has asked to stop; from now on, signals that do so arrive.

    Raises:
        ThrowcollectError: What it failed of; that is in its record, too.
    """
    signal.pthread_sigmask(signal.SIG_UNBLOCK, stop_signals())
    records = Records()
    opened = records.inherit(run, lock)
    if opened.record.kind == "container":
        launch_container(opened, CONTAINER_ORDERS.validate_json(order), onlooker=onlooker, interruptions=interruptions)
        return
    made_from = _ORDERS.validate_json(order)
    log = NodeLogs(Path(opened.record.logs)).path(LAUNCHER)
    try:
        prepare = _prepare_session if opened.record.kind == "session" else _prepare_collection
        prepared = prepare(records, opened, made_from, onlooker)
        if prepared is None:
            opened.update(ended=datetime.now(timezone.utc), exit_code=0)
            opened.close()
            return
        _move_log(log, NodeLogs(Path(prepared.record.logs)).path(LAUNCHER))
        if interruptions():
            raise Interrupted("stopped before any node was started")
    except ThrowcollectError as error:
        opened.update(ended=datetime.now(timezone.utc), exit_code=error.exit_code, failure=Failure.of(error))
        raise
    with prepared:
        prepared.launch(interruptions=interruptions)


def _move_log(before: Path, after: Path) -> None:
    """Go on printing where the logs of the nodes are, below what was printed before there was such a place.

    Raises:
        WorkerError: If that is impossible.
    """
    try:
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


def _prepare_collection(records: Records, run: OpenRun, order: Order, onlooker: Onlooker) -> PreparedRun | None:
    record = run.record
    if order.resumed:
        prepared = resume(order.output, overrides=order.overrides, ahead=True, onlooker=onlooker, run=run)
        if prepared is not None and prepared.record.run != run.run:
            # Its containers had outlived their launcher, and go on as the run that they were.
            run.forget()
        return prepared
    with load_locating_errors(order.config, order.overrides) as config:
        request = Request(
            config,
            order.config.parent,
            order.output,
            record.started,
            resumed=False,
            processes=count_cores(),
            ahead=True,
            origin=record.origin,
        )
        return prepare_run(records, request, None, onlooker, run=run)


def _prepare_session(records: Records, run: OpenRun, order: Order, onlooker: Onlooker) -> PreparedRun:
    with load_locating_errors(order.config, order.overrides) as config:
        _check_session(config)
        directory = run.directory / "data"
        directory.mkdir(exist_ok=True)
        write_file(config_path(directory), dump_yaml(config).encode())
        choice = choose(config, say=onlooker.say, warn=onlooker.warn)
        simulations = choice.runtime.simulations(config)
        run.update(runtime=choice.name, middleware=choice.middleware, simulations=simulations)
        # A dry run, as that of a collection.
        choice.runtime.host(run.record.place(run.key), config, warn=onlooker.warn).close()
        return PreparedRun(records, run, config, directory, onlooker=onlooker, runtime=choice.runtime)


def _check_session(config: Config) -> None:
    """Refuse what has no nodes that a client could talk to.

    Raises:
        ConfigError: If all is to happen in one process.
    """
    if config.run.runtime != "auto" and not get_runtime(config.run.runtime).can_be_scaled:
        raise ConfigError(
            [Problem(f"should have nodes for clients to talk to, got {config.run.runtime}", key="run.runtime")]
        )
