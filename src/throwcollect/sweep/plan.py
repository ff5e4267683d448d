"""The plan: every trial of a collection with its values, seed and hash, written down before anything runs."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from throwcollect.config.schema import Config
from throwcollect.config.values import reason_not_sweepable, with_values
from throwcollect.errors import ConfigError, DatasetError, ForeignPlanError, PlanError, Problem
from throwcollect.files import write_file
from throwcollect.sweep.digest import config_digest, trial_digests
from throwcollect.sweep.parquet_file import encode_table, read_parquet
from throwcollect.sweep.points import Points
from throwcollect.sweep.samplers import draw_points
from throwcollect.sweep.slice import Slice
from throwcollect.wording import blank_numbers, format_count

_FORMAT = "1"
_FORMAT_KEY = b"throwcollect.plan_format"
_CONFIG_KEY = b"throwcollect.config_digest"
_SLICE_KEY = b"throwcollect.slice"
_MOST_REASONS = 5

ROUND_TRIALS = 64
"""Number of trials in a round, by which a plan grows."""
FIRST_TRIALS = 2 * ROUND_TRIALS
"""Number of trials in the rounds that depend on no result."""

Check = Callable[[Config], str | None]
"""Says of the configuration of a trial why it cannot be run, or None when it can."""


@dataclass(frozen=True)
class Trial:
    """One numbered point of the sweep.

    Attributes:
        number: From 0.
        values: Value of each swept dotted key, in the key's unit.
        seed: Seed for anything random in the trial, from the root seed and the number; fits uint64.
        digest: SHA-256 in hex over everything that determines the trial's samples.
        refused: Why the trial is not run, or None.
    """

    number: int
    values: Mapping[str, float]
    seed: int
    digest: str
    refused: str | None = None


@dataclass(frozen=True)
class Plan:
    """The trials of a collection, or those of one of its slices, in order and without gaps.

    Attributes:
        config: Configuration that the trials vary.
        trials: At least one; the first one has number 0 unless they are a slice.
        slice: Which slice they are; None if they are the whole plan.
    """

    config: Config
    trials: tuple[Trial, ...]
    slice: Slice | None = None

    @property
    def keys(self) -> tuple[str, ...]:
        """Swept dotted keys."""
        return tuple(self.trials[0].values)

    def trial(self, number: int) -> Trial:
        """The trial of a number.

        Raises:
            IndexError: If the plan has no such trial.
        """
        index = number - self.trials[0].number
        if index < 0:
            raise IndexError(number)
        return self.trials[index]

    def slice_of(self, wanted: Slice) -> Plan:
        """A slice of the plan.

        Raises:
            ConfigError: If the plan has fewer shards than there are slices.
        """
        numbers = wanted.trials_of(len(self.trials), trials_per_shard=self.config.record.trials_per_shard)
        return Plan(self.config, self.trials[numbers.start : numbers.stop], wanted)

    def config_of(self, trial: Trial) -> Config:
        """Configuration of one trial."""
        return with_values(self.config, trial.values)

    def refuse(self, reasons: Sequence[str | None]) -> Plan:
        """This plan with trials refused.

        Args:
            reasons: Why each trial is not run, in order; None for those that are.

        Raises:
            PlanError: If every trial is refused.
        """
        _check_some_left([reason for reason in reasons if reason is not None], len(self.trials))
        pairs = zip(self.trials, reasons, strict=True)
        return replace(self, trials=tuple(replace(trial, refused=reason) for trial, reason in pairs))

    def write(self, path: Path) -> None:
        """Write the plan as a Parquet file, whole or not at all.

        Raises:
            DatasetError: If the file cannot be written.
        """
        write_file(path, self.encode())

    def encode(self) -> bytes:
        """Bytes of the plan's Parquet file; equal plans give equal bytes.

        Columns: ``trial`` int64, ``digest`` string, ``seed`` uint64, ``refused`` string or null, then one float64
        column per swept key, named like it.
        """
        from throwcollect.sweep.arrow_column import make_table

        columns: list[Any] = [
            [trial.number for trial in self.trials],
            [trial.digest for trial in self.trials],
            [trial.seed for trial in self.trials],
            [trial.refused for trial in self.trials],
            *([trial.values[key] for trial in self.trials] for key in self.keys),
        ]
        metadata = {_FORMAT_KEY: _FORMAT, _CONFIG_KEY: config_digest(self.config)}
        if self.slice is not None:
            metadata[_SLICE_KEY] = str(self.slice)
        schema = _schema(self.keys).with_metadata(metadata)
        return encode_table(make_table(columns, schema))

    @classmethod
    def read(cls, path: Path, config: Config, *, slice: Slice | None = None) -> Plan:
        """Read a plan that was written for a configuration.

        Args:
            path: File that `write` wrote.
            config: The configuration; its section `run` may differ.
            slice: Which slice of the plan that the file holds is wanted; None for all that it holds.

        Raises:
            DatasetError: If the file is missing, damaged, or no plan.
            ForeignPlanError: If it is the plan of another configuration.
            ConfigError: If the plan has fewer shards than there are slices.
        """
        table = read_parquet(path)
        metadata = table.schema.metadata or {}
        keys = tuple(table.column_names[4:])
        found = metadata.get(_FORMAT_KEY, b"none").decode(errors="replace")
        if found != _FORMAT or not table.schema.equals(_schema(keys)) or not table.num_rows:
            raise DatasetError(
                "not a plan that this version reads",
                path=path,
                expected=f"plan format {_FORMAT}",
                evidence=f"got {found}",
            )
        if metadata.get(_CONFIG_KEY, b"") != config_digest(config).encode():
            raise ForeignPlanError("the plan belongs to another configuration", path=path)
        for key in keys:
            if reason := reason_not_sweepable(config, key):
                raise DatasetError(f"is damaged: column {key!r}: {reason}", path=path)
        stored = metadata.get(_SLICE_KEY)
        first, rows = 0, table
        if stored is not None:
            # Its first trial has any number.
            first, slice = table["trial"][0].as_py(), Slice.parse(stored.decode())
        elif slice is not None:
            wanted = slice.trials_of(table.num_rows, trials_per_shard=config.record.trials_per_shard)
            first, rows = wanted.start, table.slice(wanted.start, len(wanted))
        numbers, digests, seeds, refused, *values = (column.to_pylist() for column in rows.columns)
        if numbers != list(range(first, first + len(numbers))):
            raise DatasetError("the trials are not numbered from 0 without gaps", path=path)
        trials = zip(numbers, zip(*values, strict=True), seeds, digests, refused, strict=True)
        return cls(config, tuple(Trial(n, dict(zip(keys, row, strict=True)), *rest) for n, row, *rest in trials), slice)


def make_plan(config: Config, *, check: Check | None = None, directory: Path | None = None) -> Plan:
    """Draw all trials of a sweep; of one that grows, its first two rounds (see `rounds`).

    Args:
        config: Configuration with the sweep.
        check: Says of the configuration of a trial why it cannot be run, or None when it can. A ConfigError that it
            raises is such a reason, too.
        directory: Directory at which a relative `sweep.file` starts; the current one when None.

    Raises:
        PlanError: If the sweep has no point, or every trial is refused.
        ConfigError: If the file of the sampler `list` cannot be used.
    """
    points = draw_points(config, directory=directory or Path())
    if config.grows:
        points = points.first(FIRST_TRIALS)
    trials = tuple(make_trials(config, points, check=check))
    return Plan(config, trials).refuse([trial.refused for trial in trials])


def make_trials(config: Config, points: Points, *, check: Check | None = None, first: int = 0) -> Iterator[Trial]:
    """The trials of points, one by one, as each is checked.

    Args:
        config: Configuration that the trials vary.
        points: Their values.
        check: Says of the configuration of a trial why it cannot be run.
        first: Number of the first one.
    """
    seeds = [_seed(config.seed, number) for number in range(first, first + len(points.values))]
    rows = zip(points.values.tolist(), seeds, trial_digests(config, points, seeds), strict=True)
    for number, (row, seed, digest) in enumerate(rows, first):
        values = dict(zip(points.keys, row, strict=True))
        refused = refusal(with_values(config, values), check) if check else None
        yield Trial(number, values, seed, digest, refused)


def _seed(root: int, number: int) -> int:
    return int(np.random.SeedSequence(root, spawn_key=(number,)).generate_state(1, np.uint64)[0])


def refusal(config: Config, check: Check) -> str | None:
    """Why the plan refuses a trial; None if it does not.

    Args:
        config: Configuration of the trial.
        check: Says why it cannot be run; a ConfigError that it raises is a reason, too.
    """
    try:
        return check(config)
    except ConfigError as error:
        return str(error)


def _check_some_left(reasons: list[str], trials: int) -> None:
    if len(reasons) < trials:
        return
    # Reasons that differ only in their numbers are one; the first of them speaks for all.
    kinds = [blank_numbers(reason) for reason in reasons]
    examples = dict(zip(reversed(kinds), reversed(reasons), strict=True))
    listed = [f"{count} × {examples[kind]}" for kind, count in Counter(kinds).most_common(_MOST_REASONS)]
    raise PlanError(
        [Problem(f"{format_count(trials, 'trial')}, all refused: {'; '.join(listed)}", key="sweep")],
        hint="sweep over smaller ranges or slower motions, or change task.start and task.end",
    )


def _schema(keys: Sequence[str]) -> Any:
    import pyarrow as pa

    kinds = {"trial": pa.int64(), "digest": pa.string(), "seed": pa.uint64(), "refused": pa.string()}
    kinds |= dict.fromkeys(keys, pa.float64())
    return pa.schema([pa.field(name, kind, nullable=name == "refused") for name, kind in kinds.items()])
