"""Prepares a run from a configuration: checks it, makes the plan and the record, and chooses the runtime."""

from __future__ import annotations

import os
from collections.abc import Sequence
from contextlib import ExitStack
from dataclasses import dataclass, replace
from datetime import datetime, timezone
from pathlib import Path
from typing import TYPE_CHECKING

from throwcollect.arguments import check_bounds
from throwcollect.config.loader import load_locating_errors
from throwcollect.config.schema import Config
from throwcollect.coordinator.onlooker import SILENT, Onlooker
from throwcollect.dataset.configuration import reading_config
from throwcollect.dataset.lock import hold_lock
from throwcollect.errors import ConfigError, Problem, WorkerError
from throwcollect.ros.middleware import Middleware
from throwcollect.ros.router_endpoint import reserve_port
from throwcollect.runs.prepared_run import PreparedRun
from throwcollect.runs.records import OpenRun, Records
from throwcollect.runs.run_record import Origin, RunRecord
from throwcollect.runs.run_selection import busy_error
from throwcollect.runtimes.registry import RuntimeChoice, choose, get_runtime

if TYPE_CHECKING:
    # This import takes long, and errors in the configuration need none of it.
    from throwcollect.sweep.plan import Plan

MANY_TRIALS = 1000
"""A plan of this many trials takes seconds, so the user is told before it is made."""


@dataclass(frozen=True)
class RunRequest:
    """The run that a user or a client asks for.

    Attributes:
        sweep_directory: Directory of the configuration's file, in which lists of trials are looked for.
        directory: Directory of the dataset.
        started: Time of the request.
        plan: The plan of the dataset that the run continues; None for a new dataset.
        processes: Number of processes that may check the trials of a large plan.
        origin: The request of a client; None if a command or a program asks.
        choice: The runtime; None if it is not chosen yet.
    """

    config: Config
    sweep_directory: Path
    directory: Path
    started: datetime
    plan: Plan | None = None
    processes: int = 1
    origin: Origin | None = None
    choice: RuntimeChoice | None = None


def prepare(
    config: str | os.PathLike[str],
    *,
    overrides: Sequence[str] = (),
    output: str | os.PathLike[str] | None = None,
    processes: int = 1,
    onlooker: Onlooker = SILENT,
) -> PreparedRun:
    """Prepare a collection into a new dataset.

    Args:
        config: The configuration's file.
        overrides: Keys to change: ``key=value`` pairs, as ``--set`` takes them.
        output: Directory of the dataset, new or empty; None names one after the configuration.
        processes: Number of processes that may check the trials of a large plan.
        onlooker: Is told what goes on.
    """
    check_bounds("processes", processes, least=1)
    started = datetime.now(timezone.utc)
    file, named = Path(config), None if output is None else Path(output)
    with load_locating_errors(file, overrides) as read:
        directory = named or _name_directory(read.name)
        records = Records()
        if (busy := next((run for run in records.into(directory) if run.status == "running"), None)) is not None:
            raise busy_error(busy.record)
        request = RunRequest(read, file.parent, directory, started, processes=processes)
        return prepare_run(records, request, onlooker)


def _name_directory(name: str) -> Path:
    """Directory of a dataset that the user did not name: ``datasets/NAME``; if that is taken, followed by the time."""
    directory = Path("datasets", name)
    taken = os.path.lexists(directory) and not (directory.is_dir() and not any(directory.iterdir()))
    return directory.with_name(f"{name}-{datetime.now():%Y%m%d-%H%M%S}") if taken else directory


def resume(
    directory: str | os.PathLike[str],
    *,
    config: str | os.PathLike[str] | None = None,
    overrides: Sequence[str] = (),
    processes: int = 1,
    simulate: bool = True,
    onlooker: Onlooker = SILENT,
    run: OpenRun | None = None,
) -> PreparedRun | None:
    """Prepare a run that continues a dataset that an earlier collection did not finish.

    Args:
        directory: Directory of the dataset.
        config: The configuration's file; None takes the configuration that lies in the directory.
        overrides: Keys to change, as for `prepare`.
        processes: Number of processes that may check the trials of a larger plan, as for `prepare`.
        simulate: Whether missing trials are run; if not, the dataset is finished at once with the episodes that are
            whole, and all other trials are lost.
        onlooker: Is told what goes on.
        run: The run, if it has a record already; None makes a new one.

    Returns:
        The run; None if every trial has ended, so that nothing is left to do, or if nothing should be simulated.
    """
    started = datetime.now(timezone.utc)
    directory = Path(directory)
    file = None if config is None else Path(config)
    with reading_config(directory, file, overrides) as read:
        sweep_directory = directory if file is None else file.parent
        if not simulate:
            from throwcollect.coordinator.resume import finish_without_simulating

            finish_without_simulating(read, directory, sweep_directory=sweep_directory, onlooker=onlooker)
            return None
        records = Records()
        clear(records, directory, onlooker, own=None if run is None else run.run)
        request = RunRequest(
            read,
            sweep_directory,
            directory,
            started,
            processes=processes,
            origin=None if run is None else run.record.origin,
        )
        planned = _plan_again(request, onlooker)
        return None if planned is None else prepare_run(records, planned, onlooker, run=run)


def _plan_again(request: RunRequest, onlooker: Onlooker) -> RunRequest | None:
    """Make the plan of a dataset to continue, and choose the runtime; None if every trial has ended."""
    from throwcollect.coordinator.resume import has_all_trials, resume

    def choose_runtime() -> None:
        # This fails before anything is written if nothing can be simulated here, so a finished dataset stays so.
        nonlocal request
        request = _choose_runtime(request, onlooker)

    plan = resume(
        request.config,
        request.directory,
        sweep_directory=request.sweep_directory,
        processes=request.processes,
        before_writing=choose_runtime,
        onlooker=onlooker,
    )
    if has_all_trials(request.directory, plan):
        onlooker.say(f"{request.directory}: every trial has ended, nothing is left to do")
        return None
    return replace(request, plan=plan)


def _choose_runtime(request: RunRequest, onlooker: Onlooker) -> RunRequest:
    """Choose the runtime of a run that continues a dataset."""
    config = request.config
    choice = choose(config, say=onlooker.say, warn=onlooker.warn)
    if (volume := config.containers.volume) and choice.runtime.has_volumes:
        raise ConfigError(
            [Problem(f"a dataset in the volume {volume} cannot be resumed from here", key="containers.volume")],
            expected="a dataset in a directory",
        )
    return replace(request, choice=choice)


def clear(records: Records, directory: Path, onlooker: Onlooker, *, own: str | None = None) -> None:
    """Refuse a directory into which a run collects, and end containers that do so although their launcher has ended.

    The run that this process prepares, whose id is `own`, is left alone.
    """
    for run in records.into(directory):
        if run.id == own:
            continue
        if run.status == "running":
            raise busy_error(run.record)
        if run.status == "ended" or not run.record.runtime:
            continue
        try:
            removed = get_runtime(run.record.runtime).remove(run.id, volumes=False)
        except WorkerError as error:
            raise WorkerError(
                f"{directory.absolute()}: containers of run {run.id} may still collect into it: {error.message}",
                hint=error.hint,
            ) from error
        if removed:
            onlooker.say(f"run {run.id}: its launcher had ended before its containers; they are ended now")


def prepare_run(
    records: Records, request: RunRequest, onlooker: Onlooker, *, run: OpenRun | None = None
) -> PreparedRun:
    """Prepare a run, a new one if `run` is None; if that fails, all files that this function made are removed."""
    config, plan = request.config, request.plan
    with ExitStack() as held, ExitStack() as undo:
        if run is None:
            run = records.new(config.name)
            undo.callback(run.forget)
        # The plan may take minutes, so a port that is taken is reported before it is made.
        reserve_port(config.run).close()
        # A runtime may take minutes to get an image, so it is chosen after all other checks. If the configuration names
        # a volume, the runtime is chosen first, because it decides whether the dataset goes into the volume.
        volume = config.containers.volume
        choice = request.choice
        if volume and choice is None:
            choice = choose(config, say=onlooker.say, warn=onlooker.warn)
        if choice is not None and not choice.runtime.has_volumes:
            volume = None
        directory = run.directory / "data" if volume else request.directory
        is_new = not directory.exists()
        if config.run.runtime in ("auto", "local"):
            # What nodes need is imported while this process makes the plan.
            from throwcollect.runtimes.node_process import begin_imports

            begin_imports()
        plan = plan or _make_plan(request, directory, onlooker)
        # These imports would take long, but making the plan has made them already.
        from throwcollect.coordinator.prepare import describe_plan
        from throwcollect.dataset.creation import remove_plan

        held.enter_context(hold_lock(directory, alone=False))
        # A resumed dataset had its files before this run, so they are removed only if the plan is new.
        if request.plan is None:
            undo.callback(remove_plan, directory, made=is_new)
        choice = choice or choose(config, say=onlooker.say, warn=onlooker.warn)
        record = _make_record(run, request, choice, directory, volume)
        # A host checks image, mounts, networks and ports when it is made, so errors show before the run is launched.
        choice.runtime.host(record.place(run.key), config, warn=onlooker.warn).close()
        run.write(record)
        _warn_if_others_may_join(config, choice.middleware, onlooker)
        onlooker.say(f"plan: {describe_plan(plan)}; dataset: {f'volume {volume}' if volume else directory}")
        return PreparedRun(
            records,
            run,
            config,
            directory,
            onlooker=onlooker,
            held=held.pop_all(),
            undo=undo.pop_all(),
        )


def _make_plan(request: RunRequest, directory: Path, onlooker: Onlooker) -> Plan:
    from throwcollect.coordinator.prepare import prepare as prepare_plan

    config = request.config
    if (config.trials or 0) >= MANY_TRIALS and config.until is None:
        onlooker.say(
            f"plan: checking {config.trials} trials against limits and collisions, 1 to 5 ms for each on one core"
        )
    return prepare_plan(
        config,
        directory,
        sweep_directory=request.sweep_directory,
        processes=request.processes,
        onlooker=onlooker,
    )


def _make_record(
    run: OpenRun, request: RunRequest, choice: RuntimeChoice, directory: Path, volume: str | None
) -> RunRecord:
    return RunRecord(
        run=run.run,
        name=request.config.name,
        runtime=choice.name,
        directory=os.path.realpath(directory),
        volume=volume,
        logs=str((run.directory if volume else directory).absolute() / "logs"),
        domain_id=request.config.run.domain_id,
        started=request.started,
        launcher=os.getpid(),
        simulations=choice.runtime.simulations(request.config),
        middleware=choice.middleware,
        origin=request.origin,
    )


def _warn_if_others_may_join(config: Config, middleware: Middleware, onlooker: Onlooker) -> None:
    """Warn the user if others may join the run."""
    if config.run.open:
        onlooker.warn("run.open: anybody who reaches the router may join, read and disturb this run")
    elif middleware.is_fast_dds:
        onlooker.warn("on Fast DDS, whoever finds the router's port may join and disturb this run; episodes are signed")
    elif not middleware.keeps_others_out:
        onlooker.warn(f"{middleware.rmw}: anybody on its network may join and disturb this run; episodes are signed")
