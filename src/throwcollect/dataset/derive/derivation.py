"""Writes a derived dataset: copies of episodes of other datasets, with the rows and the plan that belong to them."""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import groupby
from pathlib import Path

import numpy as np
import pyarrow as pa

from throwcollect.config.schema import Config
from throwcollect.config.sensors import SensorSections
from throwcollect.config.values import column_of, reason_not_sweepable, with_sensors
from throwcollect.dataset.carried_robot import carry_robot
from throwcollect.dataset.creation import create
from throwcollect.dataset.data_card import data_card
from throwcollect.dataset.derive.joined_plan import join_plans
from throwcollect.dataset.directory import CARD, SOURCES, shard_of
from throwcollect.dataset.mcap_file import episode_run
from throwcollect.dataset.provenance import Provenance, write_provenance
from throwcollect.dataset.reader import Dataset
from throwcollect.dataset.selection import find_rows
from throwcollect.dataset.shard import write_runs
from throwcollect.dataset.summary_files import write_description
from throwcollect.dataset.throw import Throw
from throwcollect.dataset.throws_table import Row, ThrowsTable, make_field
from throwcollect.episode.channels import Channels
from throwcollect.episode.episode_message import Episode
from throwcollect.errors import ConfigError, DatasetError, Problem, check_bounds, refuse_argument
from throwcollect.files import StrPath, new_directory, replacing, write_all, write_file
from throwcollect.plan.parquet_file import encode_table
from throwcollect.plan.plan import Plan
from throwcollect.progress_log import log_progress
from throwcollect.robots.description import full_description
from throwcollect.sensing.recorder import SensorRecorder
from throwcollect.sensing.sensor import check_sensors
from throwcollect.side_by_side import count_cores, limit_processes, work_side_by_side
from throwcollect.wording import command


@dataclass(frozen=True)
class Derived:
    """A dataset that was made from others.

    Attributes:
        trials: Number of its trials, each of which has an episode.
        without_episode: Number of trials that were asked for but have no episode, by outcome; they are left out.
        digest: Its digest.
    """

    trials: int
    without_episode: Mapping[str, int]
    digest: str


Copy = tuple[int, int, int]
"""A trial of the new dataset: its number there, the place of its source among all sources, and its number there."""


def derive(sources: Sequence[Dataset], output: Path, *, sensors: SensorSections | None = None) -> Derived:
    """Make the dataset that consists of copies of the throws of some others, at least one, that have an episode.

    Args:
        sources: Those throws of each source that are wanted.
        output: Directory of the new dataset, new or empty; nothing is left there after an error.
        sensors: Sections of sensors that see the throws in place of those that were recorded; None for these.
    """
    with new_directory(output) as directory:
        copied, digest = _write(sources, directory, sensors)
    left_out = (source.throws.filter(source.throws["shard"].is_null()) for source in sources)
    without = Counter(outcome for throws in left_out for outcome in throws["outcome"].to_pylist())
    return Derived(copied, dict(sorted(without.items())), digest)


def _write(sources: Sequence[Dataset], directory: Path, sensors: SensorSections | None) -> tuple[int, str]:
    """Write the dataset; returns the number of its trials, and its digest."""
    began = time.monotonic()
    plan, firsts = join_plans([source.plan for source in sources])
    # Files of robot and bodies are named as in the plan, but read where they are now.
    placed = sources[0].config
    if sensors is not None:
        plan = _with_sensors(plan, sensors)
        placed = placed.model_copy(update={"sensors": plan.config.sensors})
        check_sensors(placed)
    elif any(source.config.sensors != plan.config.sensors for source in sources):
        raise ConfigError(
            "the datasets have different sensors", hint=f"{command('dataset', 'render-sensors')} makes them alike"
        )
    copies = sorted(
        (first + trial, number, trial)
        for number, (source, first) in enumerate(zip(sources, firsts, strict=True))
        for trial in source.recorded.throws["trial"].to_pylist()
    )
    _check_copies(copies, plan)
    channels = _read_channels(sources, plan.config)
    create(directory, plan, listed=plan.trials.points if plan.config.sweep.file else None)
    carry_robot(placed, directory)
    table = ThrowsTable.of(plan)
    tables, recordings = [], []
    numbers = (number for number, *_ in log_progress(copies, len(copies), "trial", "written"))
    taken = [sources[source].throw(trial) for _, source, trial in copies]
    configs = map(replace(plan, config=placed).config_of, (plan.trial(number) for number, *_ in copies))
    # Episodes are read in order, one after the other, as they are written; pictures are rendered by all cores.
    episodes = work_side_by_side(
        [*zip(taken, configs, strict=True)],
        _begin_reading,
        (None if sensors is None else channels,),
        processes=1 if sensors is None else limit_processes(count_cores(), len(copies)),
        doing="renders",
    )
    for name, members in groupby(zip(numbers, taken, strict=True), key=lambda each: shard_of(plan, each[0])):
        held = list(members)
        runs = ((number, episode_run(next(episodes))) for number, _ in held)
        with replacing(directory / name) as descriptor:
            finished = write_runs(partial(write_all, descriptor), channels, runs, name=name)
        recordings += [finished.recording] if finished.recording else []
        tables.append(
            table.table(
                _make_row(plan, number, throw.row) | {"shard": name, "chunk_offset": finished.offsets[number]}
                for number, throw in held
            )
        )
    throws = pa.concat_tables(tables)
    provenance = Provenance.of_this_machine(
        simulations=None, wall_s=time.monotonic() - began, was_open=False, robot=channels.robot
    )
    write_file(directory / SOURCES, encode_table(_tabulate_sources(copies, sources)))
    write_file(directory / CARD, (data_card(plan.config, throws, provenance) + _describe_sources(sources)).encode())
    write_provenance(directory, provenance)
    write_description(directory, plan.config.name, throws, channels, recordings)
    return len(copies), Dataset.open(directory).digest


def _with_sensors(plan: Plan, sensors: SensorSections) -> Plan:
    """Make a copy of a plan with other sensors, among whose numbers are those that it sweeps."""
    config = with_sensors(plan.config, sensors)
    for key in plan.keys:
        if key.startswith("sensors.") and (reason := reason_not_sweepable(config, key)):
            raise ConfigError([Problem(f"the dataset sweeps it, so the sensors should have it: {reason}", key)])
    return replace(plan, config=config)


def _check_copies(copies: Sequence[Copy], plan: Plan) -> None:
    """Refuse a dataset without a trial, and one that would have a trial twice, whatever its numbers in the sources."""
    if not copies:
        raise ConfigError("no trial with an episode is left", expected="at least one")
    different = {plan.trials.digests[number].tobytes() for number, *_ in copies}
    if len(different) < len(copies):
        raise ConfigError(
            f"{len(copies) - len(different)} of {len(copies)} trials are in more than one of the datasets",
            expected="datasets that have no trial in common",
        )


def _read_channels(sources: Sequence[Dataset], config: Config) -> Channels:
    """Find what is recorded; recordings hold the description of their robot, so its package need not be installed."""
    robots = dict.fromkeys(source.robot_description() or full_description(source.config) for source in sources)
    if len(robots) > 1:
        raise ConfigError("the recordings of the datasets describe different robots or tools")
    return Channels(config, *robots)


def _begin_reading(channels: Channels | None) -> Callable[[tuple[Throw, Config]], Episode]:
    """Make the function that reads the episode of a throw; with channels, their sensors see it anew."""
    recorder = None if channels is None else SensorRecorder(channels)

    def read(piece: tuple[Throw, Config]) -> Episode:
        throw, config = piece
        with throw.locating_damage():
            episode = throw.read_episode(sensors=True)
            # The copy gets hashes of its own, which would make damage look as if it had been recorded.
            episode.chunk.check_records()
            if episode.digest != throw["digest"]:
                raise DatasetError(f"digest {episode.digest}", expected=f"{throw['digest']} as in throws.parquet")
        if recorder is not None:
            seen = recorder.record(config, episode.header.trial, episode.samples())
            episode = Episode(episode.header, episode.chunk, sensors=seen)
        return episode

    return read


def _make_row(plan: Plan, number: int, row: Row) -> Row:
    """Make the row of a copy: keys that its source does not sweep, but the new plan does, are columns here, too."""
    trial = plan.trial(number)
    values = {column_of(key): value for key, value in trial.values.items()}
    return {**row, **values, **trial.target, "trial": number}


def _tabulate_sources(copies: Sequence[Copy], sources: Sequence[Dataset]) -> pa.Table:
    """Make a table with one row a trial: the dataset and trial that it comes from."""
    facts = [(source.config.name, str(source.directory), source.digest) for source in sources]
    rows = [(number, *facts[source], trial) for number, source, trial in copies]
    return pa.Table.from_pylist([dict(zip(_SOURCES.names, row, strict=True)) for row in rows], schema=_SOURCES)


def _describe_sources(sources: Sequence[Dataset]) -> str:
    """Write the section of the data card on the datasets that the trials come from."""
    listed = "".join(
        f"- `{source.directory}` ({source.config.name}): {len(source.recorded)} trials; digest {source.digest}\n"
        for source in sources
    )
    return (
        "\n## Sources\n\nDerived from other datasets, in whose data cards the provenance of the simulations is; "
        f"`sources.parquet` has the trial of them that each trial is.\n\n{listed}"
    )


_SOURCES = pa.schema(
    [
        make_field("trial", pa.int64(), "Number of the trial here."),
        make_field("source_name", pa.string(), "Name of the dataset that the trial comes from."),
        make_field("source_directory", pa.string(), "Directory of that dataset, as it was given."),
        make_field("source_digest", pa.string(), "Digest of that dataset."),
        make_field("source_trial", pa.int64(), "Number of the trial there."),
    ]
)


def merge(directories: Sequence[StrPath], output: StrPath) -> Derived:
    """Put the trials of several datasets, at least one, into a new one.

    Datasets of one plan, such as the parts of a split, keep the numbers of their trials. Those of other plans follow.

    Raises:
        ConfigError: If there is no dataset, they differ in keys that cannot be swept or have a trial in common, or the
            directory cannot be used.
        DatasetError: If a dataset is damaged, or the new one cannot be written.
    """
    if not directories:
        raise refuse_argument("directories", "got none", expected="at least one dataset")
    return derive([Dataset.open(directory) for directory in directories], Path(output))


def filter_trials(directory: StrPath, output: StrPath, *, where: str) -> Derived:
    """Take the trials that fulfil a condition on columns of the table of throws; see `dataset.selection`.

    Raises:
        ConfigError: If the condition cannot be evaluated or no trial fulfils it, or the directory cannot be used.
        DatasetError: If the dataset is damaged, or the new one cannot be written.
    """
    dataset = Dataset.open(directory)
    chosen = replace(dataset, throws=dataset.throws.filter(find_rows(where, dataset.throws, "where")))
    if not len(chosen.recorded):
        raise refuse_argument("where", f"no trial of {dataset.directory} that has an episode fulfils {where!r}")
    return derive([chosen], Path(output))


def render_sensors(directory: StrPath, output: StrPath, sensors: SensorSections) -> Derived:
    """Copy a dataset, and let other sensors see its throws, as if it had been collected with them.

    Args:
        directory: The dataset.
        output: Directory of the new one.
        sensors: Sections of sensors by name, as below the key ``sensors`` of a configuration; may be empty.

    Raises:
        ConfigError: If a section is wrong, or the directory cannot be used.
        DatasetError: If the dataset is damaged, or the new one cannot be written.
    """
    return derive([Dataset.open(directory)], Path(output), sensors=sensors)


def sample(directory: StrPath, output: StrPath, *, count: int, seed: int = 0) -> Derived:
    """Take `count` trials at random, all equally likely and none twice; they stay in their order.

    With the same seed, a smaller sample is a part of a larger one. The seed must not be negative.

    Raises:
        ConfigError: If the dataset has fewer episodes, a number is wrong, or the directory cannot be used.
        DatasetError: If the dataset is damaged, or the new one cannot be written.
    """
    check_bounds("seed", seed, least=0)
    dataset = Dataset.open(directory)
    candidates = dataset.recorded
    if not 1 <= count <= len(candidates):
        bounds = f"from 1 to {len(candidates)}, the number of episodes of {directory}"
        raise refuse_argument("count", f"should be {bounds}, got {count}")
    places = np.sort(np.random.default_rng(seed).permutation(len(candidates))[:count])
    chosen = replace(candidates, throws=candidates.throws.take(places))
    return derive([chosen], Path(output))
