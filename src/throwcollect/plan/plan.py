"""The plan: every trial of a collection with its values, seed and digest, written before anything runs."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import accumulate
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa

from throwcollect.config.schema import Config
from throwcollect.config.task_config import is_target
from throwcollect.config.values import reason_not_sweepable, with_values
from throwcollect.errors import DatasetError, ForeignPlanError, PlanError, Problem
from throwcollect.files import write_file
from throwcollect.plan.arrow_column import make_table, nan_where_null, null_where_nan, read_numbers
from throwcollect.plan.digest import config_digest, trial_digests
from throwcollect.plan.parquet_file import encode_table, open_parquet
from throwcollect.plan.slice import Slice
from throwcollect.plan.trials import DIGEST_BYTES, Points, Trial, Trials
from throwcollect.wording import blank_numbers, format_count

_FORMAT = "1"
_FORMAT_KEY = b"throwcollect.plan_format"
_CONFIG_KEY = b"throwcollect.config_digest"
_SLICE_KEY = b"throwcollect.slice"
_JOINED_KEY = b"throwcollect.joined"
_MOST_REASONS = 5

Check = Callable[[Config], str | None]
"""Explains why the plan refuses a trial with this configuration; None if it can be run."""


@dataclass(frozen=True)
class Plan:
    """The trials of a collection, or of one of its slices, in order and without gaps.

    Attributes:
        config: Configuration that the trials vary.
        trials: At least one trial; the first trial has number 0 unless this is a slice.
        slice: Which slice this is; None for the whole plan.
        joined: If this plan joins those of merged datasets, the numbers of trials of these; else empty. An episode has
            the number that its trial has in its own plan.
    """

    config: Config
    trials: Trials
    slice: Slice | None = None
    joined: tuple[int, ...] = ()

    @property
    def keys(self) -> tuple[str, ...]:
        """Swept dotted keys."""
        return self.trials.points.keys

    def trial(self, number: int) -> Trial:
        """Return the trial of a number."""
        index = number - self.trials.first
        if index < 0:
            raise IndexError(number)
        return self.trials[index]

    @property
    def parts(self) -> tuple[int, ...]:
        """Numbers of trials of the plans that this one joins; its own number if it joins none."""
        return self.joined or (len(self.trials),)

    def first_of_part(self, number: int) -> int:
        """Return the number of the first trial of the joined plan that a trial belongs to."""
        return max((first for first in accumulate(self.joined, initial=0) if first <= number), default=0)

    def slice_of(self, wanted: Slice) -> Plan:
        """Cut a slice out of the plan."""
        numbers = wanted.trials_of(len(self.trials), trials_per_shard=self.config.record.trials_per_shard)
        return Plan(self.config, self.trials[numbers.start : numbers.stop], wanted)

    def config_of(self, trial: Trial) -> Config:
        """Make the configuration of one trial."""
        return with_values(self.config, trial.values)

    def write(self, path: Path) -> None:
        """Write the plan as a Parquet file, whole or not at all."""
        write_file(path, self.encode())

    def encode(self) -> bytes:
        """Encode the plan as Parquet; equal plans give equal bytes.

        Columns: ``trial`` int64, ``digest`` string, ``seed`` uint64, ``refused`` string or null, then one float64
        column per swept key, named like it, and one per column of targets, null where a trial has none.
        """
        trials = self.trials
        columns: list[Any] = [
            np.arange(trials.first, trials.numbers.stop),
            # All digests are written out at once, and then cut into texts of one length.
            np.frombuffer(trials.digests.tobytes().hex().encode(), f"S{2 * DIGEST_BYTES}"),
            trials.seeds,
            [trials.refused.get(number) for number in trials.numbers],
            *map(null_where_nan, trials.points.table.T),
        ]
        metadata = {_FORMAT_KEY: _FORMAT, _CONFIG_KEY: config_digest(self.config)}
        if self.slice is not None:
            metadata[_SLICE_KEY] = str(self.slice)
        if self.joined:
            metadata[_JOINED_KEY] = " ".join(map(str, self.joined))
        schema = _make_schema(trials.points.names).with_metadata(metadata)
        return encode_table(make_table(columns, schema))

    @classmethod
    def read(cls, path: Path, config: Config) -> Plan:
        """Read a plan that was written for a configuration.

        Args:
            path: File that `write` wrote.
            config: The configuration; its section `run` may differ.
        """
        with open_parquet(path) as file:
            metadata = file.schema_arrow.metadata or {}
            # The first four columns are those of every plan; the values that were drawn for each trial follow.
            columns = file.schema_arrow.names[4:]
            version = metadata.get(_FORMAT_KEY, b"none").decode(errors="replace")
            if version != _FORMAT or not file.schema_arrow.equals(_make_schema(columns)) or not file.metadata.num_rows:
                raise DatasetError(
                    "not a plan that this version reads",
                    path=path,
                    expected=f"plan format {_FORMAT}",
                    evidence=f"got {version}",
                )
            if metadata.get(_CONFIG_KEY, b"") != config_digest(config).encode():
                raise ForeignPlanError("the plan belongs to another configuration", path=path)
            # No checksum covers names of columns.
            for key in (name for name in columns if not is_target(name)):
                if reason := reason_not_sweepable(config, key):
                    raise DatasetError(f"is damaged: column {key!r}: {reason}", path=path)
            for name, reason in config.task.find_wrong_targets(tuple(filter(is_target, columns))).items():
                raise DatasetError(f"is damaged: column {name!r}: {reason}", path=path)
            table = file.read().combine_chunks()
            table.validate(full=True)
            (rows,) = table.to_batches()
            trials = _read_trials(rows, columns, path)
            slice = Slice.parse(metadata[_SLICE_KEY].decode()) if _SLICE_KEY in metadata else None
            joined = tuple(map(int, metadata.get(_JOINED_KEY, b"").split()))
        return cls(config, trials, slice, joined)


def make_trials(config: Config, points: Points, *, first: int = 0) -> Trials:
    """Make trials of points, with numbers from `first` on; none of them is refused."""
    count = len(points.values)
    seeds = np.fromiter((_make_seed(config.seed, number) for number in range(first, first + count)), np.uint64, count)
    return Trials(points, seeds, trial_digests(config, points, seeds), first=first)


def _make_seed(root: int, number: int) -> int:
    # The seed of a trial does not depend on other trials, so a plan can be continued.
    return int(np.random.SeedSequence(root, spawn_key=(number,)).generate_state(1, np.uint64)[0])


def check_some_left(found: Sequence[str | None]) -> None:
    """Make sure that a plan has something to run, given for each trial why it is refused; None if it is not."""
    reasons = [reason for reason in found if reason is not None]
    if len(reasons) < len(found):
        return
    # Reasons that differ only in their numbers are of one kind, of which the first reason is shown.
    kinds = [blank_numbers(reason) for reason in reasons]
    # A dictionary keeps the last reason of each kind, so the order is reversed.
    examples = dict(zip(reversed(kinds), reversed(reasons), strict=True))
    listed = [f"{count} × {examples[kind]}" for kind, count in Counter(kinds).most_common(_MOST_REASONS)]
    # Other reasons begin with the key that is wrong, and say what is right.
    of_motions = any("." not in reason.split(" ", 1)[0] for reason in examples.values())
    raise PlanError(
        [Problem(f"{format_count(len(reasons), 'trial')}, all refused: {'; '.join(listed)}", key="sweep")],
        hint="sweep over smaller ranges or slower motions, or change task.start and task.end" if of_motions else None,
    )


def _read_trials(rows: Any, names: Sequence[str], path: Path) -> Trials:
    """Read the trials of the table of a plan."""
    first = rows["trial"][0].as_py()
    if not np.array_equal(read_numbers(rows["trial"]), np.arange(first, first + len(rows))):
        raise DatasetError("the trials are not numbered without gaps", path=path)
    digests = "".join(rows["digest"].to_pylist())
    # The empty array gives the result its shape where no key is swept.
    table = np.column_stack([np.empty((len(rows), 0)), *(nan_where_null(rows[name]) for name in names)])
    reasons = enumerate(rows["refused"].to_pylist(), first)
    return Trials(
        Points(tuple(names), table),
        read_numbers(rows["seed"]),
        np.frombuffer(bytes.fromhex(digests), np.uint8).reshape(-1, DIGEST_BYTES),
        first=first,
        refused={number: reason for number, reason in reasons if reason is not None},
    )


def _make_schema(names: Sequence[str]) -> Any:
    kinds = {"trial": pa.int64(), "digest": pa.string(), "seed": pa.uint64(), "refused": pa.string()}
    kinds |= dict.fromkeys(names, pa.float64())
    nullable = {"refused", *filter(is_target, names)}
    return pa.schema([pa.field(name, kind, nullable=name in nullable) for name, kind in kinds.items()])
