"""Splits a dataset into parts so that throws to the same place go to the same part.

Space is cut into cells, such as squares of the ground. The hash of a cell and a seed decides to which part the cell
goes, so it does not depend on other trials. For a trial that is in no cell, because it did not land, its digest decides
on the part.
"""

from __future__ import annotations

import hashlib
import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from itertools import accumulate
from pathlib import Path

import pyarrow as pa
from pydantic import TypeAdapter, ValidationError

from throwcollect.config.section import Name
from throwcollect.dataset.derive.derivation import Derived, count_without_episode, derive
from throwcollect.dataset.reader import Dataset
from throwcollect.dataset.selection import compute
from throwcollect.errors import check_bounds, refuse_argument
from throwcollect.files import StrPath, new_directory

SQUARES = ("landing_x_m=0.05", "landing_y_m=0.05")
"""Squares of 5 cm on the ground."""
_NUMBER = re.compile(r"\s*(\d*\.?\d+|\d+/\d+)\s*")
_NAME = TypeAdapter[str](Name)
_HASHES = 2**64
_FINEST = 10**9
"""Largest denominator of a share that is given as a float."""

Cell = tuple[int, ...]
"""Number of the cell along each axis."""


@dataclass(frozen=True)
class SplitPart:
    """One part of a split.

    Attributes:
        dataset: The dataset.
        cells: Number of cells whose trials it has.
        uncelled: Number of its trials that are in no cell.
    """

    dataset: Derived
    cells: int
    uncelled: int


@dataclass(frozen=True)
class Split:
    """A dataset in parts.

    Attributes:
        parts: The parts by name, each in the directory of that name.
        without_episode: Number of trials that have no episode, by outcome; they are in no part.
    """

    parts: Mapping[str, SplitPart]
    without_episode: Mapping[str, int]


def split(
    directory: StrPath,
    output: StrPath,
    *,
    fractions: str | Mapping[str, float],
    cells: Sequence[str] = SQUARES,
    seed: int = 0,
) -> Split:
    """Split a dataset into parts, each a dataset of its own.

    Args:
        directory: The dataset.
        output: Directory that gets one directory for each part; it must be new or empty.
        fractions: Names of the parts and their shares of the cells: ``train=0.8,test=0.2``, or a mapping from names to
            shares.
        cells: Axes of the space that is cut into cells. Each is an expression on columns of the table of throws (see
            `dataset.selection`) and the width of the cells along this axis, such as ``landing_x_m=0.05``.
        seed: Seed of the choice, 0 or more.

    Raises:
        ConfigError: If fractions, cells or seed are wrong, a part gets no trial, or the directory cannot be used.
        DatasetError: If the dataset is damaged, or a part cannot be written.
    """
    check_bounds("seed", seed, least=0)
    dataset = Dataset.open(directory)
    members = assign(dataset, fractions=fractions, cells=cells, seed=seed)
    parts = {}
    with new_directory(Path(output)) as scratch:
        for name, cell_of in members.items():
            derived = derive([dataset.select(cell_of)], scratch / name, offered=len(dataset))
            held = list(cell_of.values())
            parts[name] = SplitPart(derived, len({cell for cell in held if cell is not None}), held.count(None))
    return Split(parts, count_without_episode(dataset))


def assign(
    dataset: Dataset, *, fractions: str | Mapping[str, float], cells: Sequence[str] = SQUARES, seed: int = 0
) -> dict[str, dict[int, Cell | None]]:
    """Decide which trials each part gets by the arguments of `split`.

    Returns:
        The trials of each part, each with its cell; None for a trial that is in no cell.

    Raises:
        ConfigError: If fractions or cells are wrong, or a part gets no trial.
    """
    shares = _read_shares(fractions)
    throws = dataset.recorded.throws
    places = _find_cells(cells, throws)
    members: dict[str, dict[int, Cell | None]] = {name: {} for name in shares}
    for trial, cell in zip(throws["trial"].to_pylist(), places, strict=True):
        hashed = f"trial {dataset.plan.trial(trial).digest}" if cell is None else f"cell {list(cell)}"
        part = _choose_part(hashed, shares, seed)
        members[part][trial] = cell
    if empty := [name for name, trials in members.items() if not trials]:
        raise refuse_argument(
            "fractions",
            f"{', '.join(empty)} would get none of the {len(places)} trials",
            hint="larger fractions, smaller cells, or another seed",
        )
    return members


def _find_cells(axes: Sequence[str], throws: pa.Table) -> list[Cell | None]:
    """Find the cell of each row by expressions and widths; None for a row without a finite value on an axis."""
    columns = []
    texts = tuple(axes)
    if not texts:
        raise refuse_argument("cells", "the list is empty", expected="at least one axis, such as landing_x_m=0.05")
    if texts == SQUARES and "landing_x_m" not in throws.column_names:
        # The axes were left out, so the user has not written this column.
        raise refuse_argument(
            "cells",
            "missing, as trials of this task do not land",
            expected="an expression on columns of the table and the width of cells, for each axis",
        )
    for text in texts:
        name, width = _read_pair(text, "cells", "an expression and the width of cells, such as landing_x_m=0.05")
        if not float(width) > 0:
            raise refuse_argument("cells", f"the width of cells should be above 0, got {text!r}")
        values = compute(name, throws, "cells")
        if not pa.types.is_floating(values.type):
            raise refuse_argument("cells", f"{name!r} is no number, but {values.type}")
        columns.append([_number_along(value, float(width)) for value in values.to_pylist()])
    return [None if None in cell else cell for cell in zip(*columns, strict=True)]


def _number_along(value: float | None, width: float) -> int | None:
    place = math.nan if value is None else value / width
    return math.floor(place) if math.isfinite(place) else None


def _choose_part(hashed: str, shares: Mapping[str, Fraction], seed: int) -> str:
    # Fractions are exact, so shares such as 0.1 add up to 1, and no place is beyond the last part.
    place = Fraction(int.from_bytes(hashlib.sha256(f"{seed} {hashed}".encode()).digest()[:8], "big"), _HASHES)
    return next(name for name, end in zip(shares, accumulate(shares.values()), strict=True) if place < end)


def _read_shares(given: str | Mapping[str, float]) -> dict[str, Fraction]:
    if isinstance(given, str):
        what = "a part and its share, such as train=0.8"
        pairs = [_read_pair(item, "fractions", what) for item in given.split(",")]
    else:
        # As fractions, because floats of 1/3 would not add up to 1.
        pairs = [(name, Fraction(share).limit_denominator(_FINEST)) for name, share in given.items()]
    shares = dict(pairs)
    problem = None
    if len(shares) < len(pairs):
        problem = "names a part twice"
    elif len(shares) < 2:
        problem = "should name two parts or more"
    elif any(share <= 0 for share in shares.values()):
        problem = "should be above 0"
    elif sum(shares.values()) != 1:
        problem = f"should add up to 1, add up to {float(sum(shares.values())):g}"
    for name in shares:
        try:
            _NAME.validate_python(name)
        except ValidationError:
            problem = f"{name!r} should be lower-case letters, digits, - and _"
    if problem:
        raise refuse_argument("fractions", f"{problem}, got {given!r}")
    return shares


def _read_pair(text: str, argument: str, what: str) -> tuple[str, Fraction]:
    # The expression itself may have `=` in it, such as `==`.
    name, _, number = text.rpartition("=")
    try:
        value = Fraction(number) if _NUMBER.fullmatch(number) else None
        # This raises an error if the number is too large for a float.
        float(value or 0)
    except (ValueError, ArithmeticError):
        value = None
    if value is None or not name.strip():
        raise refuse_argument(argument, f"should be {what}, got {text!r}")
    return name.strip(), value
