"""Worlds in closed form that throw like a robot, and maps that were learned in them."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray
from tests.unit.dataset.conftest import Collection

from throwcollect.config.values import column_of
from throwcollect.dataset.reader import Dataset
from throwcollect.learning.learned_map import Axis, KeyRole, LearnedMap, fit_throws

Array = NDArray[np.float64]

KEYS = ("task.duration_s", "task.end.arm_right_4_joint", "task.end.torso_1_joint")
TARGETS = ("landing_x_m", "landing_y_m")
LOW, HIGH = np.array([0.9, -1.0, -0.3]), np.array([1.3, -0.2, 0.3])
DRAG = Axis("ball.drag_coefficient", KeyRole.LATENT, 0.0, 1.0, 0.2)


def land(values: Array, drag: Array | float = 0.2) -> Array:
    """Where throws end, shape ``(n, 2)``, for values of `KEYS`, shape ``(n, 3)``."""
    speed = 1.2 / values[:, 0] * (1.0 + 0.5 * (values[:, 1] + 1.0))
    reach = speed * (1.0 - 0.15 * np.asarray(drag) * speed / 2.0)
    return np.stack([reach * np.cos(values[:, 2]), reach * np.sin(values[:, 2]) - 0.2], axis=1)


def draw(count: int, seed: int = 0, *, inside: float = 1.0) -> Array:
    """Values of `KEYS` in the middle of their ranges, of which a share is taken, shape ``(count, 3)``."""
    places = 0.5 + inside * (np.random.default_rng(seed).random((count, 3)) - 0.5)
    return LOW + (HIGH - LOW) * places


def parameter_axes() -> tuple[Axis, ...]:
    """The axes of `KEYS`."""
    middle = (LOW + HIGH) / 2
    rows = zip(KEYS, LOW.tolist(), HIGH.tolist(), middle.tolist(), strict=True)
    return tuple(Axis(key, KeyRole.PARAMETER, low, high, nominal) for key, low, high, nominal in rows)


def effort(values: Array) -> Array:
    """Largest shares of a torque limit, shape ``(n,)``: faster throws need more."""
    return 0.5 + 0.4 * (1.3 - values[:, 0]) + 0.1 * (values[:, 1] + 1.0) ** 2


@cache
def learn(count: int = 400) -> LearnedMap:
    """A map of a world that is the same in all throws."""
    values = draw(count)
    return fit_throws(parameter_axes(), TARGETS, values, land(values), effort(values))


@cache
def learn_with_drag(count: int = 400, role: KeyRole = KeyRole.LATENT) -> LearnedMap:
    """A map of worlds that differ in the ball's drag, which has this role."""
    values = draw(count)
    drag = np.random.default_rng(9).random(count)
    inputs = np.column_stack([values, drag])
    axes = (*parameter_axes(), replace(DRAG, role=role))
    return fit_throws(axes, TARGETS, inputs, land(values, drag), effort(values))


def make_dataset(directory: Path, count: int) -> Dataset:
    """A dataset whose table has throws in worlds that differ in the ball's drag; the recordings do not fit it."""
    ends = zip(KEYS, LOW.tolist(), HIGH.tolist(), strict=True)
    sweep = {key: {"min": low, "max": high} for key, low, high in ends} | {DRAG.key: {"min": 0.0, "max": 1.0}}
    found = Dataset.open(Collection({"sweep": {"sampler": "uniform", "parameters": sweep}}).collect(directory))
    values = draw(count)
    drag = np.random.default_rng(1).random(count)
    columns = dict(zip(map(column_of, KEYS), values.T, strict=True)) | dict(
        zip(TARGETS, land(values, drag).T, strict=True)
    )
    columns |= {column_of(DRAG.key): drag, "trial": np.arange(count), "outcome": ["landed"] * count}
    throws = pa.concat_tables([found.throws.slice(0, 1)] * count)
    for name, column in (columns | {"effort_peak_share": effort(values)}).items():
        field = throws.schema.field(name)
        throws = throws.set_column(throws.schema.get_field_index(name), field, pa.array(column, field.type))
    return replace(found, throws=throws)
