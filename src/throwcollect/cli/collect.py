"""`throwcollect up`, `resume`, `cover`, `join-run` and `join`: collect, in this terminal or by a detached launcher."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from throwcollect.cli.options import (
    ConfigArgument,
    DatasetArgument,
    DetachOption,
    JsonOption,
    RuntimeOption,
    SetOption,
    SimulationsOption,
    TrialsOption,
    overrides,
)
from throwcollect.cli.printing import Display, show, tell
from throwcollect.cli.streams import ensure_written
from throwcollect.config.default_path import DEFAULT_CONFIG
from throwcollect.errors import ConfigError
from throwcollect.files import write_file
from throwcollect.own_process import count_interruptions
from throwcollect.side_by_side import count_cores
from throwcollect.wording import command, format_count

if TYPE_CHECKING:
    from throwcollect.collect.runs.run import Run

LockOption = Annotated[int, typer.Option("--lock", help="Descriptor of the run's locked file.")]


def up(
    config: Path | None = None,
    *,
    simulations: SimulationsOption = None,
    settings: SetOption = None,
    runtime: RuntimeOption = None,
    output: Path | None = None,
    resume: Path | None = None,
    slice: str | None = None,
    listen: str | None = None,
    token_file: Path | None = None,
    trials: TrialsOption = None,
    detach: DetachOption = False,
    view: bool = False,
    json: JsonOption = False,
) -> None:
    """Collect a dataset: start the simulations, run all trials, write the files.

    Options:
        config (CONFIG): YAML file of the collection; throwcollect.yaml by default.
        output (--output -o DIR): Directory of the dataset; must be new or empty.
        resume (DIR): Go on with the dataset in DIR; CONFIG is its own by default.
        slice (I/N): Collect slice I of N, from 0, of the plan that lies in --output DIR.
        listen (ENDPOINT): Let other machines join, at tcp/ADDRESS:PORT: run.listen.
        token_file (FILE): With --listen: write the token to FILE, which only you can read, and do not print it.
        view: Print the address of a page on which the run is seen; starts a server.
    """
    changes = overrides(settings, trials=trials, run__simulations=simulations, run__runtime=runtime, run__listen=listen)
    if slice is not None:
        unfit = {"CONFIG": config, "--resume": resume, "--token-file": token_file, "--detach": detach, "--view": view}
        if wrong := next((name for name, value in unfit.items() if value not in (None, False)), None):
            raise ConfigError(f"{wrong}: should be left out with --slice, which goes by the plan in --output DIR")
        if output is None:
            raise ConfigError(f"--slice {slice}: needs --output DIR, in which the plan lies")
        _collect_slice(output, slice, changes, json=json)
        return
    from throwcollect.collect.runs.preparation import prepare
    from throwcollect.collect.runs.preparation import resume as go_on

    shown, cores = Display(quiet=json), count_cores()
    run: Run | None
    if resume is None:
        run = prepare(config or DEFAULT_CONFIG, overrides=changes, output=output, processes=cores, reporter=shown)
    elif output is not None:
        raise ConfigError(f"--output {output}: should be left out with --resume, which names the directory")
    else:
        _refuse_submitted(resume)
        run = go_on(resume, config=config, overrides=changes, processes=cores, reporter=shown)
    _collect(run, shown, directory=resume, detach=detach, json=json, token_file=token_file, view=view)


def _refuse_submitted(directory: Path) -> None:
    """Refuse a dataset whose slices tasks of a cluster collect."""
    from throwcollect.collect.cluster.submission import is_submitted

    if is_submitted(directory):
        raise ConfigError(
            f"--resume {directory}: was submitted, so tasks of a cluster collect it",
            hint=f"{command('resume', directory)} submits what is missing",
        )


def resume(
    directory: DatasetArgument,
    *,
    simulations: SimulationsOption = None,
    settings: SetOption = None,
    runtime: RuntimeOption = None,
    trials: TrialsOption = None,
    simulate: bool = True,
    detach: DetachOption = False,
    json: JsonOption = False,
) -> None:
    """Go on with a dataset, whatever has ended its collection or damaged its files, or add more trials to it.

    Options:
        simulate (--simulate/--no-simulate): Run missing trials, or finish without them: they are lost.
    """
    from throwcollect.collect.cluster.submission import is_submitted

    changes = overrides(settings, trials=trials, run__simulations=simulations, run__runtime=runtime)
    if is_submitted(directory):
        for name, value in {"-n": simulations, "--runtime": runtime, "--no-simulate": not simulate}.items():
            if value:
                raise ConfigError(f"{name}: should be left out, as tasks of a cluster collect {directory}")
        _resume_tasks(directory, changes, json=json)
        return
    if not simulate:
        _finish(directory, changes, json=json)
        return
    from throwcollect.collect.runs.preparation import resume as go_on

    shown = Display(quiet=json)
    run = go_on(directory, overrides=changes, processes=count_cores(), reporter=shown)
    _collect(run, shown, directory=directory, detach=detach, json=json)


def _finish(directory: Path, changes: list[str], *, json: bool) -> None:
    """Finish a dataset with what is whole; `runs` would need the libraries of the nodes."""
    from throwcollect.cli.dataset.info import print_collected
    from throwcollect.collect.coordinator.resume import finish_without_simulating
    from throwcollect.dataset.configuration import reading_config
    from throwcollect.dataset.inspect import info

    with reading_config(directory, overrides=changes) as config:
        shown = Display(quiet=json)
        finish_without_simulating(config, directory, sweep_directory=directory, reporter=shown)
    again = command("resume", directory)
    print_collected(info(directory), directory, as_json=json, hint=f"{again} runs them again")


def _resume_tasks(directory: Path, changes: list[str], *, json: bool) -> None:
    from throwcollect.collect.cluster.submit import submit_missing

    job = submit_missing(directory, overrides=changes, reporter=Display(quiet=json))
    numbers = {"array": job.array, "join": job.join} if job is not None else {"array": "", "join": ""}
    show({"directory": directory.absolute(), **numbers}, json=json)
    if job is None and not json:
        tell(f"{directory}: nothing is left to submit")


def cover(
    config: ConfigArgument = DEFAULT_CONFIG,
    *,
    output: Path | None = None,
    rounds: int = 12,
    simulations: SimulationsOption = None,
    settings: SetOption = None,
    runtime: RuntimeOption = None,
    trials: TrialsOption = None,
    json: JsonOption = False,
) -> None:
    """Spread throws evenly over the cells of sweep.target: collect, learn, aim, and collect again.

    Options:
        output (--output -o DIR): Directory of the datasets, one for each round.
        rounds (K 2..99): Number of rounds.
    """
    from throwcollect.collect.runs.covering import cover as cover_cells
    from throwcollect.config.loader import load

    changes = overrides(settings, trials=trials, run__simulations=simulations, run__runtime=runtime)
    directory = output or Path("datasets", load(config, changes).name)
    with Display(quiet=json) as shown, count_interruptions() as interruptions:
        found = cover_cells(
            config,
            directory,
            rounds=rounds,
            overrides=changes,
            processes=count_cores(),
            reporter=shown,
            interruptions=interruptions,
        )
    show(found, f"{directory}: {format_count(len(found), 'dataset')}", json=json)
    if not json:
        tell(f"make one of them: {command('dataset', 'merge', *found, directory / 'all')}")


def begin(run: str, lock: LockOption) -> None:
    """Launch a run that another process has prepared, or prepare it as well, if there is an order on standard input."""
    from throwcollect.collect.runs.background import carry_out

    order = sys.stdin.buffer.read()
    with Display(quiet=True) as shown, count_interruptions() as interruptions:
        carry_out(run, lock, order, reporter=shown, interruptions=interruptions)


def _collect_slice(directory: Path, text: str, changes: list[str], *, json: bool) -> None:
    from throwcollect.collect.runs.slices import collect_slice
    from throwcollect.dataset.slices import slice_directory
    from throwcollect.plan.slice import Slice

    slice = Slice.parse(text)
    with Display(quiet=json) as shown, count_interruptions() as interruptions:
        collect_slice(directory, slice, overrides=changes, reporter=shown, interruptions=interruptions)
    place = slice_directory(directory, slice)
    show({"slice": str(slice), "directory": place}, f"{place}: finished", json=json, indent=None)


def join_run(token: str, *, simulations: int | None = None) -> None:
    """Add simulations of this machine to a run of another one, until it is over; Ctrl-C takes them away.

    Options:
        token (TOKEN): The word that `up --listen` prints; - reads it from standard input, where no other user sees it.
        simulations (-n N 1..256): Number of simulations; one a core by default.
    """
    from throwcollect.collect.runs.joining import join_run as join

    # Interruptions are counted only afterwards, because a signal that is only counted would not end the wait for input.
    word = sys.stdin.readline() if token == "-" else token  # noqa: S105 - it is no password
    with Display(quiet=False) as shown, count_interruptions() as interruptions:
        join(word, simulations or count_cores(), reporter=shown, interruptions=interruptions)


def join(directory: DatasetArgument, json: JsonOption = False) -> None:
    """Make one dataset of the slices that `up --slice` has collected."""
    from throwcollect.cli.dataset.info import print_collected
    from throwcollect.dataset.inspect import info
    from throwcollect.dataset.slices import join as join_slices

    join_slices(directory)
    print_collected(info(directory), directory, as_json=json)


def _collect(
    run: Run | None,
    shown: Display,
    *,
    directory: Path | None,
    detach: bool,
    json: bool,
    token_file: Path | None = None,
    view: bool = False,
) -> None:
    """Launch a run and print its summary or, if it is detached, its id.

    The run is None if the dataset in the directory, with which it was to go on, is finished already.
    """
    if run is not None:
        with run:
            _announce(run, token_file, view=view)
            if detach:
                _start(run, json=json)
                return
            with shown, count_interruptions() as interruptions:
                summary = run.collect(interruptions=interruptions)
    # Imported only now, because these imports take long, and would delay the start of the nodes.
    from throwcollect.cli.dataset.info import print_collected, print_summary

    if run is not None:
        print_collected(summary, run.directory, as_json=json, hint=run.record.resume_command)
    elif directory is not None:
        from throwcollect.dataset.inspect import info

        print_summary(info(directory), directory, as_json=json)


def _announce(run: Run, token_file: Path | None, *, view: bool) -> None:
    """Hand out the token of a run that other machines may join, and the address of the page if it is asked for."""
    if token_file is not None:
        write_file(token_file, f"{run.token}\n".encode(), mode=0o600)
    elif run.config.run.listen is not None:
        # The token is a secret, so it is not given to a display, which may write to a log.
        tell(f"other machines join by: {command('join-run', run.token, '-n', 4)}")
    if view:
        from throwcollect.cli.serve import write_tunnel
        from throwcollect.serve.finding import ensure_server, make_page_address

        address = ensure_server()
        tell(f"look inside: {make_page_address(address, run.record.run)}")
        tell(write_tunnel(address))


def _start(run: Run, *, json: bool) -> None:
    """Hand the run over to a process of its own, and print how to follow it."""
    with count_interruptions() as interruptions:
        record = run.start(interruptions=interruptions).record
    show({"run": record.run, "directory": record.directory}, record.run, json=json)
    if not json:
        tell(f"follow it: {command('wait', '--run', record.run)}   (or ps, logs -f, stop)")
    ensure_written(hint=f"run {record.run} goes on; throwcollect ps lists it")
