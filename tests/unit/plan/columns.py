"""Trials in columns, from trials one by one."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from throwcollect.plan.trials import DIGEST_BYTES, Points, Trial, Trials


def in_columns(trials: Iterable[Trial]) -> Trials:
    trials = list(trials)
    return Trials(
        Points(tuple(trials[0].values), np.array([list(trial.values.values()) for trial in trials], np.float64)),
        np.array([trial.seed for trial in trials], np.uint64),
        np.frombuffer(bytes.fromhex("".join(trial.digest for trial in trials)), np.uint8).reshape(-1, DIGEST_BYTES),
        first=trials[0].number,
        refused={trial.number: trial.refused for trial in trials if trial.refused is not None},
    )
