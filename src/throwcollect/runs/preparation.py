"""From a configuration to a run that is ready to be launched: checked, planned, recorded, and with a place to live."""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from contextlib import ExitStack, suppress
from dataclasses import dataclass
from datetime import datetime, timezone
from pathlib import Path
from types import TracebackType

from throwcollect.build import build_digest
from throwcollect.config.loader import load, load_locating_errors
from throwcollect.config.schema import Config
from throwcollect.coordinator.prepare import make_self_contained, more_trials
from throwcollect.coordinator.prepare import prepare as prepare_plan
from throwcollect.coordinator.resume import begun, finished
from throwcollect.coordinator.resume import resume as resume_plan
from throwcollect.dataset.directory import CONFIG, PLAN, TRIALS, config_path
from throwcollect.dataset.lock import hold_together
from throwcollect.errors import ConfigError, Problem
from throwcollect.ros.middleware import Middleware
from throwcollect.runs.choice import Choice, choose
from throwcollect.runs.launcher import SILENT, Onlooker, launch, start_launcher, wait_for_nodes
from throwcollect.runs.record import Record, Summary
from throwcollect.runs.records import OpenRun, Records, Run
from throwcollect.runs.selection import busy, find_left_in
from throwcollect.runs.token import JoinToken
from throwcollect.runtimes.ports import format_endpoint, reach_from_elsewhere, reserve_port, split_address
from throwcollect.runtimes.runtime import Place
from throwcollect.sweep.plan import Plan
from throwcollect.wording import command, format_count

_MANY_TRIALS = 1000
"""From here on the plan takes long enough to be announced."""


class PreparedRun:
    """A run that is ready to be launched; use it as a context manager, so that nothing is left if it is not.

    Until it is launched, nobody else prepares a run into its directory.

    Attributes:
        records: All runs.
        config: Its configuration.
        directory: Directory of the dataset, as it was named; None if the dataset is in a volume.

    Args:
        records: All runs.
        run: The run, with a record.
        config: Its configuration.
        directory: Directory of the dataset, as it was named.
        onlooker: Is told what goes on.
        held: Keeps others from the directory until the launcher, which may be another process, does so itself.
        undo: Removes what was made for the run, if it is not launched.
    """

    def __init__(
        self,
        records: Records,
        run: OpenRun,
        config: Config,
        directory: Path,
        *,
        onlooker: Onlooker,
        held: ExitStack | None = None,
        undo: ExitStack | None = None,
    ) -> None:
        self.records = records
        self.config = config
        self.directory = None if run.record.volume else directory
        self._run = run
        self._onlooker = onlooker
        self._held = held or ExitStack()
        self._undo = undo or ExitStack()

    def __enter__(self) -> PreparedRun:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        with self._held:
            self._undo.close()
            self._run.close()

    @property
    def record(self) -> Record:
        """What is known of it."""
        return self._run.record

    @property
    def place(self) -> Place:
        """Where it lies."""
        return self._run.record.place(self._run.key)

    @property
    def token(self) -> str:
        """The word by which other machines join it; a secret, as whoever has it may do so.

        Raises:
            ConfigError: If it listens to this machine alone, or its key cannot be read.
        """
        if self.config.run.listen is None:
            raise ConfigError("other machines cannot join the run", hint="run.listen says where they can")
        host, port = split_address(self.config.run.listen)
        endpoint = format_endpoint("tls", reach_from_elsewhere(host), port)
        run, secret, engine = self.record.run, self._run.key.secret.hex(), self.config.sim.engine
        domain_id = self.config.run.domain_id
        return JoinToken(run, endpoint, secret, domain_id, engine, build_digest(engine)).encode()

    def collect(self, *, interruptions: Callable[[], int] = lambda: 0) -> Summary:
        """Launch it in this process, and come back when it has ended; see `launcher.launch`.

        Args:
            interruptions: How often the user has asked to stop.

        Returns:
            What the dataset holds; its outcomes say whether trials are lost.

        Raises:
            ThrowcollectError: As `launcher.launch`.
        """
        self._undo.pop_all()
        return launch(self._run, self.config, onlooker=self._onlooker, interruptions=interruptions)

    def start(self, *, interruptions: Callable[[], int] = lambda: 0) -> Run:
        """Launch it in a process of its own, which outlives this one, and come back when its nodes are started.

        Args:
            interruptions: How often the user has asked to stop; the launcher is told then, and waited for.

        Raises:
            WorkerError: If it cannot be started.
            ThrowcollectError: What it ended with, if it did so already.
        """
        self._undo.pop_all()
        record = self._run.record
        process = start_launcher(self._run)
        wait_for_nodes(self.records, record, process, interruptions=interruptions)
        return self.records.get(record.run)


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
    """

    config: Config
    sweep_directory: Path
    directory: Path
    started: datetime
    resumed: bool
    processes: int = 1


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
        overrides: What replaces keys of it: ``key=value`` pairs, as ``--set`` takes them.
        output: Directory of the dataset, new or empty; None for one that is named after the configuration.
        processes: How many processes may check the trials of a large plan; more than one import the program that calls
            this, as those of `multiprocessing` do.
        onlooker: Is told what goes on.

    Raises:
        ConfigError: If the configuration, the sweep or the output directory cannot be used.
        WorkerError: If the runtime that is asked for cannot be had.
        DatasetError: If the dataset cannot be written.
    """
    started = datetime.now(timezone.utc)
    with load_locating_errors(Path(config), overrides) as read:
        directory = Path(output or Path("datasets") / f"{read.name}-{datetime.now():%Y%m%d-%H%M%S}")
        records = Records()
        if (run := _take_over(records, directory, read, onlooker)) is not None:
            return run
        request = Request(read, Path(config).parent, directory, started, resumed=False, processes=processes)
        return prepare_run(records, request, None, onlooker)


def resume(
    directory: str | os.PathLike[str],
    *,
    config: str | os.PathLike[str] | None = None,
    overrides: Sequence[str] = (),
    check: bool = False,
    onlooker: Onlooker = SILENT,
) -> PreparedRun | None:
    """Prepare to go on with the dataset that an earlier collection has left.

    Args:
        directory: Directory of the dataset.
        config: File with its configuration; None for the configuration that lies in the directory.
        overrides: What replaces keys of it, as `prepare` takes it.
        check: Whether the files of a finished dataset are compared byte for byte, and not only by their sizes.
        onlooker: Is told what goes on.

    Returns:
        The run; None if every trial has ended, and nothing is left to do.

    Raises:
        ConfigError: If there is no such dataset, or the configuration is another one.
        WorkerError: If the runtime that is asked for cannot be had.
        DatasetError: If the dataset cannot be written.
    """
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
        if (run := _take_over(records, directory, read, onlooker)) is not None:
            return run
        sweep_directory = directory if config is None else Path(config).parent
        plan = resume_plan(read, directory, sweep_directory=sweep_directory, check=check, say=onlooker.say)
        if finished(directory, plan):
            onlooker.say(f"{directory}: every trial has ended, nothing is left to do")
            return None
        return prepare_run(records, Request(read, sweep_directory, directory, started, resumed=True), plan, onlooker)


def _take_over(records: Records, directory: Path, config: Config, onlooker: Onlooker) -> PreparedRun | None:
    """The run into a directory whose nodes go on without a launcher, with its own configuration; None if there is none.

    Raises:
        ConfigError: If it collects with another configuration, or somebody else takes it over.
    """
    if (left := find_left_in(records, directory)) is None:
        return None
    own = load(config_path(left.place.directory))
    if own.without_run() != make_self_contained(config).without_run():
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
    return PreparedRun(records, run, own, directory, onlooker=onlooker)


def prepare_run(records: Records, request: Request, plan: Plan | None, onlooker: Onlooker) -> PreparedRun:
    """A run that is ready to be launched; nothing is left behind if that fails.

    Args:
        records: All runs.
        request: What the user asked for.
        plan: The plan that lies in the directory; None if it is still to be made.
        onlooker: Is told what goes on.

    Raises:
        ConfigError: If the dataset is in a volume, from which a collection cannot go on.
        WorkerError: If the runtime that is asked for cannot be had.
        DatasetError: If another process changes the dataset, or it cannot be written.
    """
    config = request.config
    with ExitStack() as held, ExitStack() as undo:
        run = records.new(config.name)
        undo.callback(run.forget)
        reserve_port(config.run).close()
        # Getting an image may take minutes, so all that may be wrong is found before; but where there is a volume, it
        # is the runtime that decides where the dataset is.
        volume = config.containers.volume
        choice = choose(config, say=onlooker.say, warn=onlooker.warn) if volume else None
        if choice is not None and not choice.runtime.has_volumes:
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
                onlooker.say(
                    f"plan: checking {config.trials} trials against limits and collisions, 1 to 5 ms each and core"
                )
            plan = prepare_plan(
                config,
                directory,
                sweep_directory=request.sweep_directory,
                processes=request.processes,
                say=onlooker.say,
            )
        held.enter_context(hold_together(directory))
        if not request.resumed:
            undo.callback(_remove_plan, directory, made=made)
        choice = choice or choose(config, say=onlooker.say, warn=onlooker.warn)
        record = _record(run, request, choice, directory, volume)
        # A dry run: the host looks for image, mounts, networks and ports when it is made.
        choice.runtime.host(record.place(run.key), config, warn=onlooker.warn).close()
        run.write(record)
        refused = sum(trial.refused is not None for trial in plan.trials)
        note = f", {refused} refused by calculation (see `throwcollect plan`)" if refused else ""
        _warn_of_company(config, choice.middleware, onlooker)
        where = f"volume {volume}" if volume else directory
        onlooker.say(f"plan: {format_count(len(plan.trials), 'trial')}{note}{more_trials(plan)}; dataset: {where}")
        return PreparedRun(records, run, config, directory, onlooker=onlooker, held=held.pop_all(), undo=undo.pop_all())


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
