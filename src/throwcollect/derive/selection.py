"""Datasets made of some trials of one dataset, or of all trials of several.

The directory of the new dataset must be new or empty.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from throwcollect.arguments import check_bounds, refuse_argument
from throwcollect.dataset.reader import Dataset
from throwcollect.dataset.selection import find_rows
from throwcollect.derive.derivation import Derived, derive
from throwcollect.files import StrPath


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
    sources = [Dataset.open(directory) for directory in directories]
    return derive(sources, Path(output), offered=sum(map(len, sources)))


def filter_trials(directory: StrPath, output: StrPath, *, where: str) -> Derived:
    """Take the trials that fulfil a condition on columns of the table of throws; see `dataset.selection`.

    Raises:
        ConfigError: If the condition cannot be evaluated or no trial fulfils it, or the directory cannot be used.
        DatasetError: If the dataset is damaged, or the new one cannot be written.
    """
    dataset = Dataset.open(directory)
    chosen = replace(dataset, throws=dataset.throws.filter(find_rows(where, dataset.throws, "where").fill_null(False)))
    if not len(chosen.recorded):
        raise refuse_argument("where", f"no trial of {directory} that has an episode fulfils {where!r}")
    return derive([chosen], Path(output), offered=len(dataset))


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
    return derive([chosen], Path(output), offered=len(dataset))
