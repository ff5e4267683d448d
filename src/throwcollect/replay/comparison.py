"""Finds the differences between two episodes of one trial."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, fields

import numpy as np

from throwcollect.episode.episode_message import Episode
from throwcollect.episode.record import EpisodeHeader, Samples


@dataclass(frozen=True)
class Comparison:
    """How a stored throw differs from the same throw, simulated again: a sentence for each difference.

    There are no differences if the episodes, whose digests are here, too, are the same bit for bit.
    """

    trial: int
    stored: str
    again: str
    differences: tuple[str, ...]


def compare(stored: Episode, again: Episode) -> Comparison:
    """Compare two episodes of one trial."""
    stored.chunk.check_records()
    differences: tuple[str, ...] = ()
    # This compares contents and not chunks, as the same messages may be compressed in different ways.
    if (stored.chunk.contents, stored.header_json) != (again.chunk.contents, again.header_json):
        differences = tuple(_find_differences(stored, again)) or ("other channels than joint states and ball differ",)
    return Comparison(stored.header.trial, stored.digest, again.digest, differences)


def _find_differences(stored: Episode, again: Episode) -> Iterator[str]:
    for field in fields(EpisodeHeader):
        before, now = getattr(stored.header, field.name), getattr(again.header, field.name)
        if before != now:
            yield f"{field.name}: {before} stored, {now} now"
    one, other = stored.samples(again.table.joints), again.samples()
    count = min(len(one), len(other))
    for column in fields(Samples):
        before, now = getattr(one, column.name)[:count], getattr(other, column.name)[:count]
        rows = np.flatnonzero((before != now).reshape(count, -1).any(axis=1))
        if len(rows):
            largest = np.abs(before.astype(np.float64) - now).max()
            time_s = (one.stamps_ns[rows[0]] - one.stamps_ns[0]) / 1e9
            yield f"{column.name}: from {time_s:.3f} s on, by up to {largest:.3g}"
