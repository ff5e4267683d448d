"""Chooses trials to be simulated once more: at random, and the same for the same seed."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np


def choose_trials(trials: Sequence[int], *, count: int, seed: int) -> list[int]:
    """Choose at most `count` of the trials, by the root seed of the collection, and keep their order."""
    if count >= len(trials):
        return list(trials)
    picked = np.random.default_rng(seed).choice(len(trials), size=count, replace=False)
    return [trials[index] for index in sorted(picked.tolist())]
