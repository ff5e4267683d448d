"""A model without a dataset."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from throwcollect.learning.learned_map import Axis, Correction, KeyRole
from throwcollect.learning.model import Model
from throwcollect.learning.model_card import TrainedOn
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
    trained: dict[str, Any] = {"name": "quick", "robot": "talos", "task": "throw", "engine": "bullet", "digest": "0"}
    model = Model(
        version="0",
        axes=axes,
        targets=TARGETS,
        forward=straight,
        effort=flat,
        correction=none,
        errors={1: 0.002},
        blind_error=None,
        trained_on=TrainedOn(**trained, throws=throws, ignored=0),
        values=values,
        outputs=values,
        efforts=np.full(throws, 0.5),
        config="name: quick\n",
    )
    directory.parent.mkdir(exist_ok=True)
    model.save(directory)
