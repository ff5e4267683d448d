"""Draws points from the declared ranges of parameters; all randomness comes from the root seed.

`scipy.stats.qmc.Sobol` draws the same points, bit for bit; a test compares them. With this code, plans do not depend on
the version of SciPy, whose statistics take longer to import than everything else that a command needs.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from itertools import islice
from pathlib import Path
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

from throwcollect.config.schema import Config, Parameter, Values
from throwcollect.config.sweep import MOST_TRIALS
from throwcollect.errors import PlanError, Problem
from throwcollect.plan.chosen_motions import add_motions, count_motions
from throwcollect.plan.point_file import read_points
from throwcollect.plan.trials import Points
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


def _draw_sobol(count: int, dimensions: int, randomness: np.random.Generator) -> NDArray[np.float64]:
    (own,) = randomness.spawn(1)
    return draw_sobol(count, dimensions, own)


UNIT_SAMPLERS = MappingProxyType[str, UnitSampler]({"uniform": _draw_uniform, "sobol": _draw_sobol})
"""Samplers that fill the unit cube, by their names in `sweep.sampler`."""


def spread(parameter: Parameter, unit: NDArray[np.float64]) -> NDArray[np.float64]:
    """Map places from 0 to 1 to values of a parameter; each of a set of values gets an equal share."""
    if isinstance(parameter, Values):
        count = len(parameter.values)
        # A place just below 1 can be rounded to it.
        return np.array(parameter.values)[np.minimum((unit * count).astype(np.int64), count - 1)]
    if parameter.scale == "log":
        low, high = math.log(parameter.min), math.log(parameter.max)
        # Rounding may lead beyond the upper bound, and the exponential of that may be too large for a float.
        spread = exp(np.minimum(low + unit * (high - low), high))
    else:
        spread = parameter.min + unit * (parameter.max - parameter.min)
    return np.clip(spread, parameter.min, parameter.max)


def _draw_grid(parameters: dict[str, Parameter], trials: int | None) -> Points:
    axes = [_list_grid_values(parameter) for parameter in parameters.values()]
    size = math.prod(map(len, axes))
    if trials is None and size > MOST_TRIALS:
        raise PlanError(
            [Problem(f"the grid has {size} points", key="sweep.parameters")], expected=f"at most {MOST_TRIALS}"
        )
    places = np.arange(_check_count(trials, size))
    columns = []
    # The number of a point is read as digits, one for each key; the last key is the lowest digit.
    for axis in reversed(axes):
        columns.append(axis[places % len(axis)])
        places //= len(axis)
    return Points(tuple(parameters), np.column_stack(columns[::-1]))


def _list_grid_values(parameter: Parameter) -> NDArray[np.float64]:
    if isinstance(parameter, Values):
        return np.array(parameter.values)
    # `SweepConfig` makes sure that a range of a grid has a count.
    count = parameter.count or 0
    if parameter.scale == "linear":
        return np.linspace(parameter.min, parameter.max, count)
    axis = spread(parameter, np.linspace(0, 1, count))
    # The exponential of a number's logarithm is not always exactly that number.
    axis[[0, -1]] = parameter.min, parameter.max
    return axis


def _check_count(trials: int | None, available: int) -> int:
    if trials is not None and trials > available:
        raise PlanError(
            [Problem(f"should be at most {available}, as the sweep has no more points, got {trials}", key="trials")]
        )
    return available if trials is None else trials


BITS = 30
"""Bits of a coordinate; a sequence has ``2**BITS`` points."""

_TABLE = Path(__file__).with_name("joe_kuo_d6.txt")


def draw_sobol(count: int, dimensions: int, randomness: np.random.Generator) -> NDArray[np.float64]:
    """Draw the first points of a sequence that is scrambled by a random matrix and a random shift (Matousek 1998).

    Args:
        count: Number of points, from 1 to ``2**BITS``.
        dimensions: Number of coordinates, from 1 to the 1024 of the table of direction numbers.
        randomness: Source of the scrambling.

    Returns:
        Coordinates from 0 to 1, 1 excluded, shape ``(count, dimensions)``.
    """
    places = np.arange(BITS, dtype=np.uint32)
    shift = _pack(randomness.integers(2, size=(dimensions, BITS), dtype=np.uint32), places)
    # A triangular matrix with ones on its diagonal can be inverted, so scrambled points stay evenly spread.
    below = np.tril(randomness.integers(2, size=(dimensions, BITS, BITS), dtype=np.uint32), -1)
    matrices = _pack(below + np.eye(BITS, dtype=np.uint32), places[::-1])
    numbers = _multiply(matrices, _compute_direction_numbers(dimensions))
    # In Gray code, two neighbours differ in one bit: the lowest bit that is set in the index of the second neighbour.
    index = np.arange(1, count)
    flipped = np.frexp(index & -index)[1] - 1
    points = np.empty((count, dimensions))
    column = np.empty(count, dtype=np.uint32)
    for i in range(dimensions):
        column[0] = shift[i]
        column[1:] = numbers[i][flipped]
        points[:, i] = np.bitwise_xor.accumulate(column) * 2.0**-BITS
    return points


def _pack(bits: NDArray[np.uint32], places: NDArray[np.uint32]) -> NDArray[np.uint32]:
    """Pack the bits of the last axis into numbers, each at its place."""
    packed: NDArray[np.uint32] = (bits << places).sum(axis=-1, dtype=np.uint32)
    return packed


def _multiply(matrices: NDArray[np.uint32], numbers: NDArray[np.uint32]) -> NDArray[np.uint32]:
    """Multiply matrices of bits by numbers, which are columns of bits with the highest first; rows are packed alike.

    Args:
        matrices: Shape ``(dimensions, BITS)``.
        numbers: Shape ``(dimensions, count)``.
    """
    common = matrices[:, None, :] & numbers[:, :, None]
    # This folds each number onto its lowest bit, which becomes the parity of all bits: the sum of products modulo 2.
    for half in (16, 8, 4, 2, 1):
        common ^= common >> np.uint32(half)
    return _pack(common & np.uint32(1), np.arange(BITS, dtype=np.uint32)[::-1])


def _compute_direction_numbers(dimensions: int) -> NDArray[np.uint32]:
    """Compute direction numbers, shape ``(dimensions, BITS)``, by the recurrence of Bratley and Fox (1988)."""
    # The first coordinate has no polynomial in the table: its numbers before the shift are all 1 (van der Corput).
    numbers = np.ones((dimensions, BITS), dtype=np.int64)
    with open(_TABLE, encoding="ascii") as lines:
        entries = (line.split() for line in lines if not line.startswith("#"))
        for row, (_, degree, coefficients, *first) in zip(numbers[1:], islice(entries, dimensions - 1), strict=True):
            s, a = int(degree), int(coefficients)
            row[:s] = [int(word) for word in first]
            for j in range(s, BITS):
                number = row[j - s] ^ (row[j - s] << s)
                for k in range(1, s):
                    if a >> (s - 1 - k) & 1:
                        number ^= row[j - k] << k
                row[j] = number
    return (numbers << np.arange(BITS)[::-1]).astype(np.uint32)
