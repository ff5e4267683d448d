"""`throwcollect up`: from a YAML file to a dataset, in this terminal or by a launcher that outlives it."""

from __future__ import annotations

import json as jsonlib
import os
from collections.abc import Sequence
from contextlib import ExitStack, suppress
from dataclasses import dataclass
from datetime import datetime, timezone
from pathlib import Path

import typer

from throwcollect.cli.interruptions import Interruptions
from throwcollect.cli.streams import ensure_written
from throwcollect.cli.summary import print_summary
from throwcollect.cli.terminal import Display, display
from throwcollect.config.loader import load, loaded
from throwcollect.config.schema import Config
from throwcollect.coordinator.prepare import more_trials, prepare, self_contained
from throwcollect.coordinator.resume import begun, finished, resume
from throwcollect.dataset.directory import CONFIG, PLAN, TRIALS, config_path
from throwcollect.dataset.inspect import info
from throwcollect.dataset.lock import held_together
from throwcollect.errors import ConfigError, Problem
from throwcollect.ros.middleware import Middleware
from throwcollect.runtime.choice import choose
from throwcollect.runtime.detached import start_launcher, wait_for_nodes
from throwcollect.runtime.ports import reserved_port
from throwcollect.runtime.records import OpenRun, Record, Records, Run
from throwcollect.runtime.runs import busy, left_in
from throwcollect.sweep.plan import Plan
from throwcollect.wording import command, counted

_MANY_TRIALS = 1000
"""From here on the plan takes long enough to be announced."""


@dataclass(frozen=True)
class _Request:
    """What the user asked for.

    Attributes:
        config: The configuration.
        sweep_directory: Where its file lies.
        directory: Directory of the dataset.
        started: When.
        resumed: Whether the directory holds a dataset, with which the run goes on.
        check: Whether the files of a finished dataset are compared byte for byte.
    """

    config: Config
    sweep_directory: Path
    directory: Path
    started: datetime
    resumed: bool
    check: bool = False


def collect(path: Path, *, overrides: Sequence[str], output: Path | None, detach: bool, json: bool) -> None:
    """Collect a dataset and print its summary or, detached, the id of the run.

    Args:
        path: The configuration's file.
        overrides: What replaces keys of it.
        output: Directory of the dataset, new or empty; None for one that is named after the configuration.
        detach: Whether to return as soon as the nodes are started.
        json: Whether to print JSON.

    Raises:
        ConfigError: If the configuration, the sweep or the output directory cannot be used.
        WorkerError: If nodes cannot be started or kept alive.
        DatasetError: If the dataset cannot be written.
        Interrupted: If the user stopped the collection.
        OutputError: If the dataset is complete, but its summary cannot be printed.
    """
    started = datetime.now(timezone.utc)
    with loaded(path, overrides) as config:
        directory = output or Path("datasets") / f"{config.name}-{datetime.now():%Y%m%d-%H%M%S}"
        _collect(_Request(config, path.parent, directory, started, resumed=False), detach=detach, json=json)


def go_on(
    directory: Path, *, path: Path | None, overrides: Sequence[str], detach: bool, json: bool, check: bool = False
) -> None:
    """Go on with the dataset that an earlier collection has left, and print as `collect` does.

    Args:
        directory: Directory of the dataset.
        path: File with its configuration; None for the configuration that lies in the directory.
        overrides: What replaces keys of it.
        detach: Whether to return as soon as the nodes are started.
        json: Whether to print JSON.
        check: Whether the files of a finished dataset are compared byte for byte, and not only by their sizes.

    Raises:
        ConfigError: If there is no such dataset, or the configuration is another one.
        WorkerError: If nodes cannot be started or kept alive.
        DatasetError: If the dataset cannot be written.
        Interrupted: If the user stopped the collection.
        OutputError: If the dataset is complete, but its summary cannot be printed.
    """
    started = datetime.now(timezone.utc)
    if not begun(directory):
        raise ConfigError(f"{directory}: holds no dataset", expected="a directory that throwcollect up has made")
    with ExitStack() as places:
        try:
            config = places.enter_context(loaded(path or config_path(directory), overrides))
        except ConfigError as error:
            hint = f"{command('up', 'CONFIG', '--resume', directory)}, if the dataset's own file is damaged"
            raise ConfigError(error.problems, hint=error.hint if path else hint) from error
        sweep_directory = directory if path is None else path.parent
        request = _Request(config, sweep_directory, directory, started, resumed=True, check=check)
        _collect(request, detach=detach, json=json)


def _collect(request: _Request, *, detach: bool, json: bool) -> None:
    directory = request.directory
    records = Records()
    # The directory is held until the launcher, which may be another process, holds it itself.
    with ExitStack() as held:
        with display(quiet=json, bar=not detach) as shown:
            ready = _ready(records, request, shown, held)
            if ready is not None and not detach:
                from throwcollect.runtime.launcher import launch

                with Interruptions() as interruptions:
                    run, config = ready
                    summary, lost = launch(run, config, onlooker=shown, interruptions=lambda: interruptions.count)
        if ready is None:
            print_summary(info(directory).as_dict(), directory, as_json=json)
        elif detach:
            _detach(records, ready[0], json=json)
        else:
            print_summary(summary, None if run.record.volume else directory, as_json=json)
            if lost is not None:
                raise lost


def _ready(records: Records, request: _Request, shown: Display, held: ExitStack) -> tuple[OpenRun, Config] | None:
    """A run that is ready to be launched, and its configuration; None if there is nothing left to do."""
    config, directory = request.config, request.directory
    left = left_in(records, directory)
    if left is not None:
        run, config = _taken_over(records, left, config)
        run.record.middleware.joining.settle()
        fate = "died" if left.status == "died" else "given up"
        shown.say(f"run {run.run}: its launcher had {fate}; it goes on where its containers are")
        return run, config
    plan = None
    if request.resumed:
        plan = resume(config, directory, sweep_directory=request.sweep_directory, check=request.check, say=shown.say)
        if finished(directory, plan):
            shown.say(f"{directory}: every trial has ended, nothing is left to do")
            return None
    return _prepared(records, request, plan, shown, held), config


def serve(run: str, lock: int) -> None:
    """Launch a prepared run in this process, which outlives the one that prepared it.

    Args:
        run: Id of the run.
        lock: Descriptor of its locked file, which this process has inherited.

    Raises:
        ConfigError: If its record or configuration cannot be read.
        WorkerError: If nodes cannot be started or kept alive.
        DatasetError: If the dataset cannot be written.
        Interrupted: If somebody stopped the collection.
    """
    with display(quiet=True) as shown, Interruptions() as interruptions:
        inherited = Records().inherited(run, lock)
        inherited.record.middleware.joining.settle()
        from throwcollect.runtime.launcher import launch

        config = load(config_path(Path(inherited.record.directory)))
        launch(inherited, config, onlooker=shown, interruptions=lambda: interruptions.count)


def _prepared(records: Records, request: _Request, plan: Plan | None, shown: Display, held: ExitStack) -> OpenRun:
    """A run that is ready to be launched; nothing is left behind if that fails.

    Until `held` is closed, nobody else prepares a run into its directory.
    """
    config = request.config
    with ExitStack() as undo:
        run = records.new(config.name)
        undo.callback(run.forget)
        reserved_port(config.run.router_port).close()
        # Getting an image may take minutes, so all that may be wrong is found before; but where there is a volume, it
        # is the runtime that decides where the dataset is.
        volume = config.containers.volume
        choice = choose(config, say=shown.say, warn=shown.warn) if volume else None
        if choice is not None and choice.runtime == "local":
            volume = None
        if volume and plan is not None:
            raise ConfigError(
                [Problem(f"a dataset in the volume {volume} cannot be resumed from here", key="containers.volume")],
                expected="a dataset in a directory",
            )
        directory = run.directory / "data" if volume else request.directory
        made = not directory.exists()
        if plan is None:
            if (config.trials or 0) >= _MANY_TRIALS and not config.grows:
                shown.say(f"plan: checking {config.trials} trials against limits and collisions, about 5 ms each")
            plan = prepare(config, directory, sweep_directory=request.sweep_directory)
        held.enter_context(held_together(directory))
        if not request.resumed:
            undo.callback(_remove_plan, directory, made=made)
        choice = choice or choose(config, say=shown.say, warn=shown.warn)
        choice.middleware.joining.settle()
        record = Record(
            run=run.run,
            name=config.name,
            runtime=choice.runtime,
            directory=str(directory.absolute()),
            volume=volume,
            logs=str((run.directory if volume else directory).absolute() / "logs"),
            domain_id=config.run.domain_id,
            started=request.started,
            launcher=os.getpid(),
            simulations=config.run.simulations,
            begun_in=os.getcwd(),
            middleware=choice.middleware,
        )
        from throwcollect.runtime.launcher import place_of

        # A dry run: constructing the runtime checks image, mounts, networks and ports.
        place_of(record, config, run.key, warn=shown.warn).close()
        run.write(record)
        undo.pop_all()
    refused = sum(trial.refused is not None for trial in plan.trials)
    note = f", {refused} refused by calculation (see `throwcollect plan`)" if refused else ""
    _warn_of_company(config, choice.middleware, shown)
    where = f"volume {volume}" if volume else directory
    shown.say(f"plan: {counted(len(plan.trials), 'trial')}{note}{more_trials(plan)}; dataset: {where}")
    return run


def _warn_of_company(config: Config, middleware: Middleware, shown: Display) -> None:
    """Say in one line that others may join a run, if they may."""
    if config.run.open:
        shown.warn("run.open: anybody who reaches the router may join, read and disturb this run")
    elif middleware.is_fast_dds:
        shown.warn("on Fast DDS, whoever finds the router's port may join and disturb this run; episodes are signed")
    elif not middleware.keeps_others_out:
        shown.warn(f"{middleware.rmw}: anybody on its network may join and disturb this run; episodes are signed")


def _remove_plan(directory: Path, *, made: bool) -> None:
    with suppress(OSError):
        for name in (CONFIG, PLAN, TRIALS):
            (directory / name).unlink(missing_ok=True)
        if made:
            directory.rmdir()


def _taken_over(records: Records, left: Run, config: Config) -> tuple[OpenRun, Config]:
    """A run that has no launcher any more, with its own configuration."""
    record = left.record
    own = load(config_path(Path(record.directory)))
    if own.without_run() != self_contained(config).without_run():
        raise ConfigError(
            f"{record.directory}: run {record.run} collects into it, with another configuration",
            hint=f"{command('down', '--run', record.run)} ends that run",
        )
    run = records.take(record.run)
    if run is None:
        raise busy(record)
    # Its containers are there until this launcher has removed them, whatever happens to it.
    run.update(ended=None, exit_code=None, message="", left=True)
    return run, own


def _detach(records: Records, run: OpenRun, *, json: bool) -> None:
    """Hand the run over to a process of its own, and say how to follow it."""
    record = run.record
    with Interruptions() as interruptions:
        process = start_launcher(run)
        wait_for_nodes(records, record, process, interruptions=lambda: interruptions.count)
    if json:
        where = {"volume": record.volume} if record.volume else {"directory": record.directory}
        typer.echo(jsonlib.dumps({"run": record.run, **where}, indent=2))
    else:
        typer.echo(record.run)
        typer.echo(f"follow it: {command('wait', '--run', record.run)}   (or ps, logs -f, stop)", err=True)
    ensure_written(hint=f"run {record.run} goes on; throwcollect ps lists it")
