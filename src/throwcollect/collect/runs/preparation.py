"""Prepares a run from a configuration: checks it, makes the plan and the record, and chooses the runtime."""

from __future__ import annotations

import os
from collections.abc import Sequence
from contextlib import ExitStack, suppress
from dataclasses import replace
from datetime import datetime
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from throwcollect.collect.coordinator.reporter import SILENT, Reporter
from throwcollect.collect.runs.launcher import launch
from throwcollect.collect.runs.records import Records
from throwcollect.collect.runs.run import Run
from throwcollect.collect.runs.run_selection import refuse_busy
from throwcollect.collect.runtimes.run_record import RunRecord
from throwcollect.collect.runtimes.runtime import choose, get_runtime
from throwcollect.config.loader import load_locating_errors
from throwcollect.config.schema import Config
from throwcollect.dataset.configuration import reading_config
from throwcollect.dataset.lock import hold_lock
from throwcollect.errors import ThrowcollectError, WorkerError, check_bounds
from throwcollect.members import find_modules
from throwcollect.ros.middleware import Middleware
from throwcollect.ros.router_endpoint import reserve_port

if TYPE_CHECKING:
    from collections.abc import Callable

    from throwcollect.plan.plan import Plan


def prepare(
    config: str | os.PathLike[str],
    *,
    overrides: Sequence[str] = (),
    output: str | os.PathLike[str] | None = None,
    processes: int = 1,
    reporter: Reporter = SILENT,
    run: Run | None = None,
) -> Run:
    """Prepare a collection into a new dataset.

    Args:
        config: The configuration's file.
        overrides: Keys to change: ``key=value`` pairs, as ``--set`` takes them.
        output: Directory of the dataset, new or empty; None names one after the configuration.
        processes: Number of processes that may check the trials of a large plan.
        reporter: Receives the progress.
        run: The run, if it has a record already; None makes a new one.
    """
    check_bounds("processes", processes, least=1)
    file = Path(config)
    with load_locating_errors(file, overrides) as read:
        directory = _name_directory(read.name) if output is None else Path(output)
        refuse_busy(directory, own=run)

        def draw() -> Plan:
            from throwcollect.collect.coordinator.prepare import prepare as prepare_plan

            return prepare_plan(read, directory, sweep_directory=file.parent, processes=processes, reporter=reporter)

        return prepare_run(read, directory, draw, reporter=reporter, run=run)


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
    reporter: Reporter = SILENT,
    run: Run | None = None,
) -> Run | None:
    """Prepare a run that continues a dataset that an earlier collection did not finish.

    Args:
        directory: Directory of the dataset.
        config: The configuration's file; None takes the configuration that lies in the directory.
        overrides: Keys to change, as for `prepare`.
        processes: Number of processes that may check the trials of a larger plan, as for `prepare`.
        reporter: Receives the progress.
        run: The run, if it has a record already; None makes a new one.

    Returns:
        The run; None if every trial has ended, so that nothing is left to do.
    """
    directory = Path(directory)
    file = None if config is None else Path(config)
    choices: list[tuple[str, Middleware]] = []
    with reading_config(directory, file, overrides) as read:
        # This import takes long, and errors in the configuration need none of it.
        from throwcollect.collect.coordinator.resume import has_all_trials
        from throwcollect.collect.coordinator.resume import resume as resume_plan

        end_left(directory, reporter, own=run)
        plan = resume_plan(
            read,
            directory,
            sweep_directory=directory if file is None else file.parent,
            processes=processes,
            # This fails before anything is written if nothing can be simulated here, so a finished dataset stays so.
            before_writing=lambda: choices.append(choose(read, reporter)),
            reporter=reporter,
        )
        if has_all_trials(directory, plan):
            reporter.say(f"{directory}: every trial has ended, nothing is left to do")
            return None
        return prepare_run(read, directory, plan, reporter=reporter, run=run, choice=choices[0] if choices else None)


def end_left(directory: Path, reporter: Reporter, *, own: Run | None = None) -> None:
    """Refuse a directory into which a run collects, and end containers that do so although their launcher has ended."""
    for run in refuse_busy(directory, own=own):
        if run.status == "ended" or not run.record.runtime:
            continue
        try:
            removed = get_runtime(run.record.runtime).remove(run.id)
        except WorkerError as error:
            raise WorkerError(
                f"{directory.absolute()}: containers of run {run.id} may still collect into it: {error.message}",
                hint=error.hint,
            ) from error
        if removed:
            reporter.say(f"run {run.id}: its launcher had ended before its containers; they are ended now")


def prepare_run(
    config: Config,
    directory: Path,
    plan: Plan | Callable[[], Plan],
    *,
    reporter: Reporter,
    run: Run | None = None,
    choice: tuple[str, Middleware] | None = None,
) -> Run:
    """Prepare a run into a directory; if that fails, all files that this function made are removed.

    Args:
        config: The configuration.
        directory: Directory of the dataset.
        plan: The plan of the dataset in the directory, or a function that makes a new one there.
        reporter: Receives the progress.
        run: The run, if it has a record already; None makes a new one.
        choice: Name of the runtime and the middleware of its nodes; None if they are not chosen yet.
    """
    with ExitStack() as held, ExitStack() as undo:
        if run is None:
            run = Records().new(config.name)
            undo.callback(run.forget)
            record = run.begin(config.name, directory)
        else:
            record = run.record
        # The plan may take minutes, so a port that is taken is reported before it is made.
        reserve_port(config.run).close()
        is_new = not directory.exists()
        if config.run.runtime in ("auto", "local"):
            # What nodes need is imported, and a loop compiled, while this process makes the plan.
            from throwcollect.collect.runtimes.local import begin_imports

            begin_imports(*find_modules("engines", config.sim.engine), foreseen=config.model_dump_json())
        made = plan() if callable(plan) else plan
        # These imports would take long, but making the plan has made them already.
        from throwcollect.collect.coordinator.prepare import describe_plan
        from throwcollect.dataset.creation import remove_plan

        held.enter_context(hold_lock(directory, alone=False))
        # A resumed dataset had its files before this run, so they are removed only if the plan is new.
        if callable(plan):
            undo.callback(remove_plan, directory, made=is_new)
        # A runtime may take minutes to get an image, so it is chosen after all other checks.
        choice = choice or choose(config, reporter)
        place, logs = Path(os.path.realpath(directory)), directory.absolute() / "logs"
        run.write(add_runtime(replace(record, directory=place, logs=logs), config, *choice, reporter=reporter))
        _warn_if_others_may_join(config, choice[1], reporter)
        reporter.say(f"plan: {describe_plan(made)}; dataset: {directory}")
        if config.sensors:
            from throwcollect.collect.coordinator.sensor_cost import measure_sensors

            # Nodes may be able to simulate what this process cannot.
            with suppress(ThrowcollectError):
                if (cost := measure_sensors(made)).throws > 1:
                    reporter.say(cost.words)
        launching = partial(launch, config=config, reporter=reporter)
        return run.prepared(config, directory, launching, held=held.pop_all(), undo=undo.pop_all())


def add_runtime(
    record: RunRecord, config: Config, name: str, middleware: Middleware, *, reporter: Reporter
) -> RunRecord:
    """Complete a record by the runtime of its run, and check that this can host the run."""
    runtime = get_runtime(name)
    simulations = config.run.simulations if runtime.can_be_scaled else 1
    domain, launcher = config.run.domain_id, os.getpid()
    record = replace(
        record, runtime=name, middleware=middleware, simulations=simulations, domain_id=domain, launcher=launcher
    )
    # A host checks image, mounts, networks and ports when it is made, so errors show before the run is launched.
    runtime.host(record, config, warn=reporter.warn).close()
    return record


def _warn_if_others_may_join(config: Config, middleware: Middleware, reporter: Reporter) -> None:
    """Warn the user if others may join the run."""
    if config.run.open:
        reporter.warn("run.open: any process that reaches the router may join, read and disturb this run")
    elif middleware.is_fast_dds:
        reporter.warn(
            "on Fast DDS, any program that finds the router may join and disturb this run; episodes are signed"
        )
    elif not middleware.keeps_others_out:
        reporter.warn(f"{middleware.rmw}: programs on its network may join and disturb this run; episodes are signed")
