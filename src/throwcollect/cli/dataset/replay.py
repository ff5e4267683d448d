"""`throwcollect dataset replay`: simulates stored throws again, and compares the results."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from throwcollect.cli.options import DatasetArgument, JsonOption
from throwcollect.cli.printing import align, show
from throwcollect.errors import ConfigError, DatasetError
from throwcollect.wording import format_count


def replay(
    directory: DatasetArgument,
    *,
    trials: list[int] | None = None,
    everything: bool = False,
    sample: int | None = None,
    engine: str | None = None,
    json: JsonOption = False,
) -> None:
    """Simulate stored throws again and compare them bit for bit; exit code 4 if any differs.

    Options:
        trials (--trial K): Number of a trial; may be repeated.
        everything (--all): All trials.
        sample (N 1..): With --all: N of them, chosen at random.
        engine (NAME): Simulate them with another engine: how much differs?
    """
    from throwcollect.dataset.reader import Dataset
    from throwcollect.replay.audit import replay_throws, select_trials

    if bool(trials) == everything:
        raise ConfigError("which throws?", expected="either --trial K, which may be repeated, or --all")
    if sample is not None and not everything:
        raise ConfigError("--sample: should be given with --all")
    dataset = Dataset.open(directory)
    known = dataset.throws["trial"].to_pylist()
    for trial in trials or ():
        if trial not in known:
            raise ConfigError(f"{directory}: no trial {trial}", expected=f"trials from {known[0]} to {known[-1]}")
        # A trial without an episode is refused here, before any throw is simulated.
        dataset.episode(trial)
    chosen = list(dict.fromkeys(trials or ())) or select_trials(dataset, sample=sample)
    if engine is not None:
        _compare_engines(directory, engine, chosen, json=json)
        return
    comparisons = list(replay_throws(directory, chosen))
    wrong = [f"trial {each.trial}: {'; '.join(each.differences)}" for each in comparisons if each.differences]
    throws = format_count(len(comparisons), "throw")
    show(comparisons, *(wrong or [f"{directory}: {throws} replayed, the same bit for bit"]), json=json)
    if wrong:
        raise DatasetError(
            f"{directory}: {len(wrong)} of {throws} came out differently",
            hint="its README.md says with which processor and versions it was made",
        )


def _compare_engines(directory: Path, engine: str, trials: Sequence[int], *, json: bool) -> None:
    """Simulate throws with another engine, and print by how much the results differ."""
    from throwcollect.replay.audit import distributions, simulate_with

    deviations = list(simulate_with(directory, engine, trials))
    found = distributions(deviations)
    differ = sum(each.stored != each.again for each in deviations)
    columns = ("mean", "rms", "median", "largest")
    rows = [(each.column, f"{each.throws}", *(f"{getattr(each, name):.3g}" for name in columns)) for each in found]
    counts = f"{directory}: {format_count(len(deviations), 'throw')} by {engine}; {differ} with another outcome"
    lines = [*align([(f"by {engine}, above stored", "throws", *columns), *rows], numbers=True), counts]
    show({"throws": deviations, "columns": found}, *lines, json=json)
