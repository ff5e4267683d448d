"""Splits a dataset into parts so that throws to the same place go to the same part.

The ground is cut into squares. The hash of a square and a seed decides to which part the square goes, so it does not
depend on other trials. For a trial that ended in no square, because it did not land, its digest decides on the part.
"""

from __future__ import annotations

import hashlib
import math
from collections.abc import Mapping
from fractions import Fraction
from itertools import accumulate
from pathlib import Path

from pydantic import TypeAdapter, ValidationError

from throwcollect.config.section import Name
from throwcollect.dataset.derive.derivation import Derived, derive
from throwcollect.dataset.reader import Dataset
from throwcollect.errors import check_bounds, refuse_argument
from throwcollect.files import StrPath, new_directory
from throwcollect.plan.arrow_column import nan_where_null

SQUARE_M = 0.05
"""Side of a square [m]."""
_NAME = TypeAdapter[str](Name)
_HASHES = 2**64
_FINEST = 10**9
"""Largest denominator of a share."""


def split(
    directory: StrPath, output: StrPath, *, fractions: str | Mapping[str, float], seed: int = 0
) -> dict[str, Derived]:
    """Split a dataset into parts, each a dataset of its own; trials without an episode are in no part.

    Args:
        directory: The dataset.
        output: Directory that gets one directory for each part; it must be new or empty.
        fractions: Names of the parts and their shares of the squares: ``train=0.8,test=0.2``, or a mapping from names
            to shares.
        seed: Seed of the choice, 0 or more.

    Returns:
        The parts by name.

    Raises:
        ConfigError: If fractions or seed are wrong, a part gets no trial, or the directory cannot be used.
        DatasetError: If the dataset is damaged, or a part cannot be written.
    """
    check_bounds("seed", seed, least=0)
    dataset = Dataset.open(directory)
    members = assign(dataset, fractions=fractions, seed=seed)
    with new_directory(Path(output)) as scratch:
        return {name: derive([dataset.select(trials)], scratch / name) for name, trials in members.items()}


def assign(dataset: Dataset, *, fractions: str | Mapping[str, float], seed: int = 0) -> dict[str, list[int]]:
    """Decide which trials each part gets by the arguments of `split`.

    Raises:
        ConfigError: If fractions are wrong, or a part gets no trial.
    """
    shares = _read_shares(fractions)
    throws, events = dataset.recorded.throws, dataset.config.task.events
    # Tasks without such an event have no squares.
    names = [name for name in (f"{events[-1]}_{axis}_m" for axis in "xy" if events) if name in throws.column_names]
    places = zip(*(nan_where_null(throws[name].combine_chunks()).tolist() for name in names), strict=True)
    members: dict[str, list[int]] = {name: [] for name in shares}
    for trial in throws["trial"].to_pylist():
        place = next(places, ())
        if place and all(map(math.isfinite, place)):
            hashed = f"cell {[math.floor(part / SQUARE_M) for part in place]}"
        else:
            hashed = f"trial {dataset.plan.trial(trial).digest}"
        # Fractions are exact, so shares such as 0.1 add up to 1, and no number is beyond the last part.
        number = Fraction(int.from_bytes(hashlib.sha256(f"{seed} {hashed}".encode()).digest()[:8], "big"), _HASHES)
        ends = zip(shares, accumulate(shares.values()), strict=True)
        members[next(name for name, end in ends if number < end)].append(trial)
    if empty := [name for name, trials in members.items() if not trials]:
        raise refuse_argument(
            "fractions",
            f"{', '.join(empty)} would get none of the {len(throws)} trials",
            hint="larger fractions, or another seed",
        )
    return members


def _read_shares(given: str | Mapping[str, float]) -> dict[str, Fraction]:
    """Read the share of each part; together, they are 1."""
    try:
        pairs = [item.split("=") for item in given.split(",")] if isinstance(given, str) else list(given.items())
        # As fractions, because floats of 1/3 would not add up to 1.
        shares = {_NAME.validate_python(name): Fraction(share).limit_denominator(_FINEST) for name, share in pairs}
    except (ValueError, ArithmeticError, ValidationError) as error:
        raise refuse_argument("fractions", f"got {given!r}", expected="names and shares: train=0.8,test=0.2") from error
    total = sum(shares.values())
    if not 2 <= len(shares) == len(pairs) or min(shares.values()) <= 0 or total != 1:
        problem = f"should be shares above 0 of two parts or more, which add up to 1, got {given!r}"
        raise refuse_argument("fractions", problem)
    return shares
