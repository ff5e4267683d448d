"""`throwcollect dataset info`, `verify` and `replay`, and the summary with which a collection ends."""

from __future__ import annotations

import json as jsonlib
from pathlib import Path
from typing import TYPE_CHECKING

import typer

from throwcollect.cli.options import DatasetArgument, JsonOption
from throwcollect.cli.printing import show
from throwcollect.cli.streams import ensure_written
from throwcollect.errors import ConfigError, DatasetError
from throwcollect.extras import install_command
from throwcollect.side_by_side import count_cores
from throwcollect.units import unit_of_name
from throwcollect.wording import command, format_count

if TYPE_CHECKING:
    from throwcollect.dataset.summary import Info, MissSummary


def info(directory: DatasetArgument, *, json: JsonOption = False) -> None:
    """Print what a dataset holds."""
    from throwcollect.dataset.inspect import info as summarise

    found = summarise(directory)
    show(found, describe(found), json=json)


def verify(
    directory: DatasetArgument, *, replay: int | None = None, render: int | None = None, json: JsonOption = False
) -> None:
    """Check a dataset against itself and against physics; exit code 4 if anything is wrong.

    Options:
        replay (N 0..): Simulate N throws again, chosen by the seed; 10 by default, where engine and libraries are the
            same.
        render (N 0..): Render what sensors see of N throws again; 2 by default.
    """
    from throwcollect.dataset.reader import Dataset
    from throwcollect.dataset.verify import find_unchecked
    from throwcollect.replay import count_replayed, verify_dataset

    findings = verify_dataset(directory, replay=replay, render=render, processes=count_cores())
    if findings:
        show(findings, *map(str, findings), json=json)
        raise DatasetError(f"{directory}: {format_count(len(findings), 'finding')}")
    dataset = Dataset.open(directory)
    count = count_replayed(dataset, replay)
    replayed = f"replayed: {count} of {format_count(len(dataset.recorded), 'throw')}"
    show([], f"{directory}: nothing wrong", replayed + ", the same bit for bit" * bool(count), json=json)
    if left_out := find_unchecked(dataset.config):
        typer.echo(f"not checked without the extra collect: {', '.join(left_out)}", err=json)
        typer.echo(f"  try: {install_command('collect')}", err=json)


def replay(
    directory: DatasetArgument,
    *,
    trials: list[int] | None = None,
    everything: bool = False,
    json: JsonOption = False,
) -> None:
    """Simulate stored throws again and compare them bit for bit; exit code 4 if any differs.

    Options:
        trials (--trial K): Number of a trial; may be repeated.
        everything (--all): All trials.
    """
    from throwcollect.dataset.reader import Dataset
    from throwcollect.replay import replay_throws, select_trials

    if bool(trials) == everything:
        raise ConfigError("which throws?", expected="either --trial K, which may be repeated, or --all")
    dataset = Dataset.open(directory)
    known = dataset.throws["trial"].to_pylist()
    for trial in trials or ():
        if trial not in known:
            raise ConfigError(f"{directory}: no trial {trial}", expected=f"trials from {known[0]} to {known[-1]}")
        # A trial without an episode is refused here, before any throw is simulated.
        dataset.episode(trial)
    chosen = list(dict.fromkeys(trials or ())) or select_trials(dataset)
    comparisons = list(replay_throws(directory, chosen))
    wrong = [f"trial {each.trial}: {'; '.join(each.differences)}" for each in comparisons if each.differences]
    throws = format_count(len(comparisons), "throw")
    show(comparisons, *(wrong or [f"{directory}: {throws} replayed, the same bit for bit"]), json=json)
    if wrong:
        raise DatasetError(
            f"{directory}: {len(wrong)} of {throws} came out differently",
            hint="its README.md has the processor and the versions with which it was made",
        )


def print_collected(found: Info, directory: Path | None, *, as_json: bool, hint: str | None = None) -> None:
    """Print the summary of a collection that has ended as `print_summary` does, and fail if it has lost trials."""
    from throwcollect.dataset.summary import explain_loss

    print_summary(found, directory, as_json=as_json)
    if (lost := explain_loss(found.outcomes, hint=hint)) is not None:
        raise lost


def print_summary(found: Info, directory: Path | None, *, as_json: bool) -> None:
    """Print the summary of a collection, and how to look into its dataset, if its directory is known."""
    show(found, describe(found), json=as_json)
    look = command("dataset", "info", directory) if directory is not None else None
    if look is not None and not as_json:
        typer.echo(f"look into it: {look}   (or open the .mcap files in Foxglove)")
        typer.echo(f"see it all:   {command('dataset', 'report', directory)}   (a page with every plot)")
        typer.echo(f"in Python:    dataset = throwcollect.load({jsonlib.dumps(str(directory))})")
    ensure_written(hint=look and f"{look} prints it again")


def describe(found: Info) -> str:
    """Put the summary of a dataset into words, one fact a line."""
    outcomes = ", ".join(f"{count} {outcome}" for outcome, count in found.outcomes.items())
    lines = {
        "trials": f"{found.trials}: {outcomes}{_describe_shortage(found)}",
        **({found.end: _describe_landing(found)} if found.end else {}),
        **{name: _describe_misses(name, misses) for name, misses in found.misses.items()},
        "episodes": f"{found.episodes}, {found.samples} samples, {found.duration_s:.0f} s of simulated time",
        "files": f"{found.shards} MCAP of {found.recordings_bytes / 1e6:.1f} MB, "
        f"{found.size_bytes / 1e6:.1f} MB in all",
        "topics": ", ".join(f"{topic} ({count})" for topic, count in found.topics.items()),
        "digest": found.digest,
    }
    if found.wall_s:
        speed = found.episodes / found.wall_s
        factor = found.duration_s / found.wall_s
        lines["took"] = (
            f"{found.wall_s:.1f} s, {speed:.1f} {found.noun}s/s, {factor:.1f} x real time, start of the nodes included"
        )
    width = max(map(len, lines))
    return "\n".join(f"{key:{width}}  {text}" for key, text in lines.items())


def _describe_shortage(found: Info) -> str:
    if found.wanted is None or found.outcomes.get(found.success, 0) >= found.wanted:
        return ""
    return f"; {found.wanted} should have {found.success}, but all trials were used up"


def _describe_misses(name: str, misses: MissSummary) -> str:
    targets = f"{misses.measured} of {format_count(misses.targets, 'target')}"
    if misses.median is None:
        return targets
    median, share90, _ = misses.format_misses(unit_of_name(name))
    return f"{targets}: median {median}, 9 of 10 below {share90}"


def _describe_landing(found: Info) -> str:
    if found.landing is None:
        return "no ball landed" if found.end == "landing" else "none"
    # Adding 0 turns a negative zero into 0.
    x, y = ([round(end, 3) + 0.0 for end in found.landing[name]] for name in ("x_m", "y_m"))
    return f"x {x[0]:.3f} to {x[1]:.3f} m, y {y[0]:.3f} to {y[1]:.3f} m"
