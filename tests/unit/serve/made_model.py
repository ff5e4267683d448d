"""A model without a dataset."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from throwcollect.learning.learned_map import Axis, Correction, KeyRole, Kind, LearnedMap
from throwcollect.learning.model_directory import write_model
from throwcollect.learning.model_file import ModelFile, TrainedOn
from throwcollect.learning.polynomial import Polynomial

KEYS = ("task.a", "task.b")
TARGETS = ("landing_x_m", "landing_y_m")


def make_model(directory: Path, throws: int = 400) -> None:
    """A model of a world in which a throw ends where its parameters say."""
    axes = tuple(Axis(key, KeyRole.PARAMETER, -1.0, 1.0, 0.0) for key in KEYS)
    values = np.random.default_rng(0).uniform(-1, 1, (throws, 2))
    straight = Polynomial(np.array([[0, 0], [1, 0], [0, 1]]), np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]]))
    flat = Polynomial(np.array([[0, 0]]), np.array([[0.5]]))
    none = Correction(np.zeros(2), np.zeros(0), np.zeros(2))
    learned = LearnedMap(Kind.LOCAL, axes, TARGETS, straight, flat, values, values, np.full(throws, 0.5), none)
    trained: dict[str, Any] = {"name": "quick", "robot": "talos", "task": "throw", "engine": "bullet", "digest": "0"}
    file = ModelFile(
        version="0",
        kind=Kind.LOCAL,
        axes=axes,
        targets=TARGETS,
        forward=straight,
        effort=flat,
        correction=none,
        trained_on=TrainedOn(
            **trained,
            throws=throws,
            ignored=0,
            selection=None,
            folds_error={1: 0.002},
            without_latents=None,
            latents_count=False,
        ),
        adaptation=None,
    )
    directory.parent.mkdir(exist_ok=True)
    write_model(directory, file, learned, np.arange(throws), "name: quick\n")
