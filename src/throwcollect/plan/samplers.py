"""Draws points from the declared ranges of parameters; all randomness comes from the root seed."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

from throwcollect.config.schema import Config, Parameter, Range, Values
from throwcollect.config.sweep import MOST_TRIALS
from throwcollect.errors import PlanError, Problem
from throwcollect.plan.chosen_motions import add_motions, count_motions
from throwcollect.plan.point_file import read_points
from throwcollect.plan.points import Points
from throwcollect.plan.sobol import MOST_DIMENSIONS, draw_sobol
from throwcollect.reproducible_math import exp

_TRIALS_PER_SUCCESS = 10
"""Most trials per wanted success, for configurations with `until` and without `trials`."""

UnitSampler = Callable[[int, int, np.random.Generator], NDArray[np.float64]]
"""Draws points of the unit cube, shape ``(n_trials, n_keys)``, given both numbers and the source of randomness."""


def draw_points(config: Config, *, directory: Path) -> Points:
    """Draw the points of all trials; for a plan that grows, as many as it may reach.

    The first points of `uniform` and `sobol` do not depend on the number of points, so trials stay the same when their
    number is raised. In a `grid`, the last key varies fastest. A relative `sweep.file` starts at `directory`.
    """
    sweep = config.sweep
    if sweep.file is not None:
        points = read_points(directory / sweep.file, config)
        return points[: _check_count(config.trials, len(points.values))]
    if not sweep.parameters and (motions := count_motions(config)):
        return add_motions(Points((), np.empty((_check_count(config.trials, motions), 0))), config)
    if not sweep.parameters:
        raise PlanError(
            [Problem("nothing is swept", key="sweep.parameters")],
            expected="at least one key, such as task.duration_s: {min: 0.9, max: 1.3}",
        )
    if sweep.sampler == "grid":
        return add_motions(_draw_grid(sweep.parameters, config.trials), config)
    trials = config.trials
    if trials is None and config.until is not None:
        trials = _TRIALS_PER_SUCCESS * config.until.wanted
    if trials is None:
        raise PlanError([Problem(f"missing; the sampler {sweep.sampler} draws any number of trials", key="trials")])
    randomness = np.random.default_rng(np.random.SeedSequence(config.seed))
    unit = UNIT_SAMPLERS[sweep.sampler](trials, len(sweep.parameters), randomness)
    columns = [spread(parameter, unit[:, i]) for i, parameter in enumerate(sweep.parameters.values())]
    return add_motions(Points(tuple(sweep.parameters), np.column_stack(columns)), config)


def _draw_uniform(count: int, dimensions: int, randomness: np.random.Generator) -> NDArray[np.float64]:
    return randomness.random((count, dimensions))


def _draw_latin_hypercube(count: int, dimensions: int, randomness: np.random.Generator) -> NDArray[np.float64]:
    """Draw points so that each of `count` equal strips along each key holds one; SciPy draws the same points."""
    # SciPy's samplers spawn a generator from the one that they are given, and draw from the spawned one.
    (own,) = randomness.spawn(1)
    places = own.uniform(size=(count, dimensions))
    strips = np.tile(np.arange(1, count + 1), (dimensions, 1))
    for strip in strips:
        own.shuffle(strip)
    return np.asarray((strips.T - places) / count)


def _draw_sobol(count: int, dimensions: int, randomness: np.random.Generator) -> NDArray[np.float64]:
    if dimensions > MOST_DIMENSIONS:
        raise PlanError(
            [Problem(f"{dimensions} keys are swept", key="sweep.parameters")],
            expected=f"at most {MOST_DIMENSIONS} with the sampler sobol; uniform takes any number",
        )
    (own,) = randomness.spawn(1)
    return draw_sobol(count, dimensions, own)


UNIT_SAMPLERS = MappingProxyType[str, UnitSampler](
    {"uniform": _draw_uniform, "latin_hypercube": _draw_latin_hypercube, "sobol": _draw_sobol}
)
"""Samplers that fill the unit cube, by their names in `sweep.sampler`."""


def spread(parameter: Parameter, unit: NDArray[np.float64]) -> NDArray[np.float64]:
    """Map places from 0 to 1 to values of a parameter; each of a set of values gets an equal share."""
    if isinstance(parameter, Values):
        count = len(parameter.values)
        # A place in the last strip of a Latin hypercube can be rounded to 1.
        return np.array(parameter.values)[np.minimum((unit * count).astype(np.int64), count - 1)]
    if parameter.scale == "log":
        low, high = math.log(parameter.min), math.log(parameter.max)
        # Rounding may lead beyond the upper bound, and the exponential of that may be too large for a float.
        spread = exp(np.minimum(low + unit * (high - low), high))
    else:
        spread = parameter.min + unit * (parameter.max - parameter.min)
    return np.clip(spread, parameter.min, parameter.max)


def _draw_grid(parameters: dict[str, Parameter], trials: int | None) -> Points:
    size = math.prod(len(key.values) if isinstance(key, Values) else _require_count(key) for key in parameters.values())
    if trials is None and size > MOST_TRIALS:
        raise PlanError(
            [Problem(f"the grid has {size} points", key="sweep.parameters")], expected=f"at most {MOST_TRIALS}"
        )
    places = np.arange(_check_count(trials, size))
    columns = []
    # The number of a point is read as digits, one for each key; the last key is the lowest digit.
    for parameter in reversed(parameters.values()):
        axis = _list_grid_values(parameter)
        columns.append(axis[places % len(axis)])
        places //= len(axis)
    return Points(tuple(parameters), np.column_stack(columns[::-1]))


def _list_grid_values(parameter: Parameter) -> NDArray[np.float64]:
    if isinstance(parameter, Values):
        return np.array(parameter.values)
    if parameter.scale == "linear":
        return np.linspace(parameter.min, parameter.max, _require_count(parameter))
    axis = spread(parameter, np.linspace(0, 1, _require_count(parameter)))
    # The exponential of a number's logarithm is not always exactly that number.
    axis[[0, -1]] = parameter.min, parameter.max
    return axis


def _require_count(parameter: Range) -> int:
    if parameter.count is None:
        raise ValueError("a range without count has no grid points")
    return parameter.count


def _check_count(trials: int | None, available: int) -> int:
    if trials is not None and trials > available:
        raise PlanError(
            [Problem(f"should be at most {available}, as the sweep has no more points, got {trials}", key="trials")]
        )
    return available if trials is None else trials
