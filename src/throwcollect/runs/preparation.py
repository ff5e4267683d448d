"""From a configuration to a run that is ready to be launched: checked, planned, recorded, and with a place to live."""

from __future__ import annotations

import os
from collections.abc import Sequence
from contextlib import ExitStack, suppress
from dataclasses import dataclass
from datetime import datetime, timezone
from pathlib import Path
from typing import TYPE_CHECKING

from throwcollect.config.loader import load, load_locating_errors
from throwcollect.config.schema import Config
from throwcollect.dataset.directory import CONFIG, PLAN, TRIALS, config_path
from throwcollect.dataset.lock import hold_lock
from throwcollect.errors import ConfigError, Problem
from throwcollect.ros.middleware import Middleware
from throwcollect.runs.choice import Choice, begin, choose
from throwcollect.runs.onlooker import SILENT, Onlooker
from throwcollect.runs.prepared_run import PreparedRun
from throwcollect.runs.record import Origin, Record
from throwcollect.runs.records import OpenRun, Records
from throwcollect.runs.selection import busy, find_left_in
from throwcollect.runtimes.ports import reserve_port
from throwcollect.wording import command, format_count

if TYPE_CHECKING:
    # What takes long to import is imported when the runtime has begun what it can, at the same time.
    from throwcollect.sweep.plan import Plan

_MANY_TRIALS = 1000
"""From here on the plan takes long enough to be announced."""


@dataclass(frozen=True)
class Request:
    """What the user asked for.

    Attributes:
        config: The configuration.
        sweep_directory: Where its file lies.
        directory: Directory of the dataset.
        started: When.
        resumed: Whether the directory holds a dataset, with which the run goes on.
        processes: How many processes may check the trials of a large plan.
        ahead: Whether the runtime begins what it can before there is a plan, for `PreparedRun.collect`.
        origin: What a client asked for; None if a command or a program did.
    """

    config: Config
    sweep_directory: Path
    directory: Path
    started: datetime
    resumed: bool
    processes: int = 1
    ahead: bool = False
    origin: Origin | None = None


def prepare(
    config: str | os.PathLike[str],
    *,
    overrides: Sequence[str] = (),
    output: str | os.PathLike[str] | None = None,
    processes: int = 1,
    ahead: bool = False,
    onlooker: Onlooker = SILENT,
) -> PreparedRun:
    """Prepare a collection into a new dataset.

    Args:
        config: The configuration's file.
        overrides: What replaces keys of it: ``key=value`` pairs, as ``--set`` takes them.
        output: Directory of the dataset, new or empty; None for one that is named after the configuration.
        processes: How many processes may check the trials of a large plan; more than one import the program that calls
            this, as those of `multiprocessing` do.
        ahead: Whether processes that nodes need start while the plan is made, which is worth it if `collect` follows;
            they end with the run, or when it is left.
        onlooker: Is told what goes on.

    Raises:
        ConfigError: If the configuration, the sweep or the output directory cannot be used.
        WorkerError: If the runtime that is asked for cannot be had.
        DatasetError: If the dataset cannot be written.
    """
    started = datetime.now(timezone.utc)
    with load_locating_errors(Path(config), overrides) as read:
        directory = _name_directory(read.name) if output is None else Path(output)
        records = Records()
        if (run := _take_over(records, directory, read, onlooker)) is not None:
            return run
        request = Request(
            read, Path(config).parent, directory, started, resumed=False, processes=processes, ahead=ahead
        )
        return prepare_run(records, request, None, onlooker)


def _name_directory(name: str) -> Path:
    """Where a dataset goes if nobody says so: ``datasets/NAME``, or with the time behind it where something is."""
    directory = Path("datasets", name)
    taken = os.path.lexists(directory) and not (directory.is_dir() and not any(directory.iterdir()))
    return directory.with_name(f"{name}-{datetime.now():%Y%m%d-%H%M%S}") if taken else directory


def resume(
    directory: str | os.PathLike[str],
    *,
    config: str | os.PathLike[str] | None = None,
    overrides: Sequence[str] = (),
    check: bool = False,
    ahead: bool = False,
    onlooker: Onlooker = SILENT,
    run: OpenRun | None = None,
) -> PreparedRun | None:
    """Prepare to go on with the dataset that an earlier collection has left.

    Args:
        directory: Directory of the dataset.
        config: File with its configuration; None for the configuration that lies in the directory.
        overrides: What replaces keys of it, as `prepare` takes it.
        check: Whether the files of a finished dataset are compared byte for byte, and not only by their sizes.
        ahead: As `prepare` takes it.
        onlooker: Is told what goes on.
        run: The run, if it has a record already; None for a new one.

    Returns:
        The run; None if every trial has ended, and nothing is left to do.

    Raises:
        ConfigError: If there is no such dataset, or the configuration is another one.
        WorkerError: If the runtime that is asked for cannot be had.
        DatasetError: If the dataset cannot be written.
    """
    from throwcollect.coordinator.resume import begun, finished
    from throwcollect.coordinator.resume import resume as resume_plan

    started = datetime.now(timezone.utc)
    directory = Path(directory)
    if not begun(directory):
        raise ConfigError(f"{directory}: holds no dataset", expected="a directory that throwcollect up has made")
    with ExitStack() as places:
        try:
            read = places.enter_context(
                load_locating_errors(Path(config) if config else config_path(directory), overrides)
            )
        except ConfigError as error:
            hint = f"{command('up', 'CONFIG', '--resume', directory)}, if the dataset's own file is damaged"
            raise ConfigError(error.problems, hint=error.hint if config else hint) from error
        records = Records()
        own = None if run is None else run.run
        if (left := _take_over(records, directory, read, onlooker, own=own)) is not None:
            return left
        sweep_directory = directory if config is None else Path(config).parent
        plan = resume_plan(read, directory, sweep_directory=sweep_directory, check=check, say=onlooker.say)
        if finished(directory, plan):
            onlooker.say(f"{directory}: every trial has ended, nothing is left to do")
            return None
        origin = None if run is None else run.record.origin
        request = Request(read, sweep_directory, directory, started, resumed=True, ahead=ahead, origin=origin)
        return prepare_run(records, request, plan, onlooker, run=run)


def _take_over(
    records: Records, directory: Path, config: Config, onlooker: Onlooker, *, own: str | None = None
) -> PreparedRun | None:
    """The run into a directory whose nodes go on without a launcher, with its own configuration; None if there is none.

    Raises:
        ConfigError: If it collects with another configuration, or somebody else takes it over.
    """
    if (left := find_left_in(records, directory, own=own)) is None:
        return None
    from throwcollect.coordinator.prepare import make_self_contained

    kept = load(config_path(left.place.directory))
    if kept.without_run() != make_self_contained(config).without_run():
        raise ConfigError(
            f"{left.record.directory}: run {left.id} collects into it, with another configuration",
            hint=f"{command('down', '--run', left.id)} ends that run",
        )
    run = records.take(left.id)
    if run is None:
        raise busy(left.record)
    # Its containers are there until this launcher has removed them, whatever happens to it.
    run.update(ended=None, exit_code=None, failure=None, left=True)
    fate = "died" if left.status == "died" else "given up"
    onlooker.say(f"run {run.run}: its launcher had {fate}; it goes on where its containers are")
    return PreparedRun(records, run, kept, directory, onlooker=onlooker)


def prepare_run(
    records: Records, request: Request, plan: Plan | None, onlooker: Onlooker, *, run: OpenRun | None = None
) -> PreparedRun:
    """A run that is ready to be launched; nothing is left behind if that fails.

    Args:
        records: All runs.
        request: What the user asked for.
        plan: The plan that lies in the directory; None if it is still to be made.
        onlooker: Is told what goes on.
        run: The run, if it has a record already, which is kept even so; None for a new one.

    Raises:
        ConfigError: If the dataset is in a volume, from which a collection cannot go on.
        WorkerError: If the runtime that is asked for cannot be had.
        DatasetError: If another process changes the dataset, or it cannot be written.
    """
    config = request.config
    with ExitStack() as held, ExitStack() as undo:
        if (begun := begin(config) if request.ahead else None) is not None:
            undo.callback(begun.runtime.close)
        if run is None:
            run = records.new(config.name)
            undo.callback(run.forget)
        reserve_port(config.run).close()
        # Getting an image may take minutes, so all that may be wrong is found before; but where there is a volume, it
        # is the runtime that decides where the dataset is.
        volume = config.containers.volume
        choice = choose(config, say=onlooker.say, warn=onlooker.warn, begun=begun) if volume else None
        if choice is not None and not choice.runtime.has_volumes:
            volume = None
        if volume and plan is not None:
            raise ConfigError(
                [Problem(f"a dataset in the volume {volume} cannot be resumed from here", key="containers.volume")],
                expected="a dataset in a directory",
            )
        directory = run.directory / "data" if volume else request.directory
        made = not directory.exists()
        plan = plan or _make_plan(request, directory, onlooker)
        held.enter_context(hold_lock(directory, alone=False))
        if not request.resumed:
            undo.callback(_remove_plan, directory, made=made)
        choice = choice or choose(config, say=onlooker.say, warn=onlooker.warn, begun=begun)
        record = _record(run, request, choice, directory, volume)
        # A dry run: the host looks for image, mounts, networks and ports when it is made.
        choice.runtime.host(record.place(run.key), config, warn=onlooker.warn).close()
        run.write(record)
        _warn_of_company(config, choice.middleware, onlooker)
        onlooker.say(f"plan: {_in_words(plan)}; dataset: {f'volume {volume}' if volume else directory}")
        return PreparedRun(
            records,
            run,
            config,
            directory,
            onlooker=onlooker,
            runtime=choice.runtime,
            held=held.pop_all(),
            undo=undo.pop_all(),
        )


def _make_plan(request: Request, directory: Path, onlooker: Onlooker) -> Plan:
    from throwcollect.coordinator.prepare import prepare as prepare_plan

    config = request.config
    if (config.trials or 0) >= _MANY_TRIALS and not config.grows:
        onlooker.say(f"plan: checking {config.trials} trials against limits and collisions, 1 to 5 ms each and core")
    return prepare_plan(
        config, directory, sweep_directory=request.sweep_directory, processes=request.processes, say=onlooker.say
    )


def _in_words(plan: Plan) -> str:
    from throwcollect.coordinator.prepare import more_trials

    refused = len(plan.trials.refused)
    note = f", {refused} refused by calculation (see `throwcollect plan`)" if refused else ""
    return f"{format_count(len(plan.trials), 'trial')}{note}{more_trials(plan)}"


def _record(run: OpenRun, request: Request, choice: Choice, directory: Path, volume: str | None) -> Record:
    return Record(
        run=run.run,
        name=request.config.name,
        runtime=choice.name,
        directory=str(directory.absolute()),
        volume=volume,
        logs=str((run.directory if volume else directory).absolute() / "logs"),
        domain_id=request.config.run.domain_id,
        started=request.started,
        launcher=os.getpid(),
        simulations=choice.runtime.simulations(request.config),
        begun_in=os.getcwd(),
        middleware=choice.middleware,
        origin=request.origin,
    )


def _warn_of_company(config: Config, middleware: Middleware, onlooker: Onlooker) -> None:
    """Say in one line that others may join a run, if they may."""
    if config.run.open:
        onlooker.warn("run.open: anybody who reaches the router may join, read and disturb this run")
    elif middleware.is_fast_dds:
        onlooker.warn("on Fast DDS, whoever finds the router's port may join and disturb this run; episodes are signed")
    elif not middleware.keeps_others_out:
        onlooker.warn(f"{middleware.rmw}: anybody on its network may join and disturb this run; episodes are signed")


def _remove_plan(directory: Path, *, made: bool) -> None:
    with suppress(OSError):
        for name in (CONFIG, PLAN, TRIALS):
            (directory / name).unlink(missing_ok=True)
        if made:
            directory.rmdir()
