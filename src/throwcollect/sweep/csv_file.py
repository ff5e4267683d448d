"""Reads lists of numbers from CSV files: UTF-8, a header line, commas, decimals with a point."""

from __future__ import annotations

import csv
import math
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from throwcollect.errors import ConfigError, Problem
from throwcollect.files import suggest_path
from throwcollect.wording import format_count

MOST_PROBLEMS = 20


def read_csv(
    path: Path,
    choose: Callable[[tuple[str, ...], int], Sequence[str]],
    *,
    may_be_empty: Callable[[str], bool] = lambda _name: False,
) -> tuple[tuple[str, ...], NDArray[np.float64], list[int]]:
    """Read some columns of a CSV file.

    Args:
        path: The file.
        choose: Chooses the columns from their names in the header and its line.
        may_be_empty: Whether cells of a column may be empty.

    Returns:
        The columns; their numbers, shape ``(n_rows, n_columns)``, NaN where a cell is empty; and the lines of the rows.
    """
    problems: list[Problem] = []
    rows: list[list[float]] = []
    lines: list[int] = []
    try:
        # Spreadsheets write a byte order mark, hence the encoding; `csv` wants line ends as they are, hence `newline`.
        with path.open(encoding="utf-8-sig", newline="") as file:
            reader = csv.reader(file, skipinitialspace=True)
            # Empty lines are skipped, above the header as well as below it.
            filled = (cells for cells in reader if len(cells) > 1 or "".join(cells).strip())
            header = tuple(name.strip() for name in next(filled, ()))
            names = tuple(choose(header, reader.line_num))
            for cells in filled:
                line = reader.line_num
                if len(cells) != len(header):
                    sentence = f"should have {format_count(len(header), 'value')}, got {len(cells)}"
                    problems.append(Problem(sentence, path=path, line=line))
                    continue
                row = {name: cell.strip() for name, cell in zip(header, cells, strict=True)}
                numbers = {name: _read_number(row[name]) for name in names}
                for name, number in numbers.items():
                    if not math.isfinite(number) and not (may_be_empty(name) and not row[name]):
                        problems.append(Problem(f"should be a number, got {row[name]!r}", name, path, line))
                rows.append(list(numbers.values()))
                lines.append(line)
                if len(problems) >= MOST_PROBLEMS:
                    break
    except UnicodeDecodeError as error:
        raise ConfigError([Problem("should be UTF-8 text", path=path)]) from error
    except csv.Error as error:
        raise ConfigError([Problem(f"not valid CSV: {error}", path=path)]) from error
    except FileNotFoundError as error:
        raise ConfigError([Problem(f"no such file{suggest_path(path)}", path=path)]) from error
    except OSError as error:
        raise ConfigError([Problem(f"cannot be read: {error.strerror}", path=path)]) from error
    if problems:
        raise ConfigError(problems[:MOST_PROBLEMS])
    return names, np.array(rows).reshape(len(rows), len(names)), lines


def _read_number(cell: str) -> float:
    """Read the number in a cell; NaN if it holds none."""
    try:
        return float(cell)
    except ValueError:
        return math.nan
