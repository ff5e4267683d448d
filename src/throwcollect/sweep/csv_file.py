"""Reads lists of numbers from CSV files: UTF-8, a header line, commas, decimals with a point."""

from __future__ import annotations

import csv
import math
import re
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
) -> tuple[tuple[str, ...], NDArray[np.float64], NDArray[np.intp], list[Problem]]:
    """Read some columns of a CSV file.

    Args:
        path: The file.
        choose: Chooses the columns from their names in the header and its line; its `ConfigError` is raised unless
            the header shows that the file as a whole is of another kind.
        may_be_empty: Whether cells of a column may be empty.

    Returns:
        The columns; the rows that hold only numbers, shape ``(n_rows, n_columns)``, NaN where a cell may be empty and
        is; the lines of these rows; and the problems of all others, or the first 20.
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
            try:
                names = tuple(choose(header, reader.line_num))
            except ConfigError as error:
                if other := _explain_header(header):
                    sentence = f"the first line should hold the names of the columns, separated by commas, got {other}"
                    raise ConfigError([Problem(sentence, path=path, line=reader.line_num)]) from error
                raise
            for cells in filled:
                numbers, wrong = _read_row(cells, header, names, may_be_empty)
                problems += [Problem(sentence, name, path, reader.line_num) for name, sentence in wrong.items()]
                if not wrong:
                    rows.append(numbers)
                    lines.append(reader.line_num)
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
    values = np.array(rows).reshape(len(rows), len(names))
    return names, values, np.array(lines, np.intp), problems


def _explain_header(header: Sequence[str]) -> str:
    """Say what a header is if it is no list of names that are separated by commas; empty if it may be one."""
    text = ",".join(header)
    kinds = {
        "a line that only Excel reads": text.startswith("sep="),
        "a comment sign": text.startswith(("#", "%", "//")),
        "JSON": text.startswith(("[", "{")),
        "semicolons": ";" in text,
        "tabs": "\t" in text,
        "bars": "|" in text,
        "blanks": re.fullmatch(r"[\w.]+(\s+[\w.]+)+", text) is not None,
        "numbers": text != "" and all(map(_is_number, re.split(r"[,\s]+", text))),
        "a column without a name, as the index of pandas has (to_csv(..., index=False) leaves it out)": text.startswith(
            (",", "Unnamed: ")
        ),
        "a comma at the end": text.endswith(","),
    }
    return next((kind for kind, fits in kinds.items() if fits), "")


def _read_row(
    cells: Sequence[str], header: Sequence[str], names: Sequence[str], may_be_empty: Callable[[str], bool]
) -> tuple[list[float], dict[str, str]]:
    """Read the numbers of a row, NaN where a cell may be empty and is, and say what is wrong with it, by column."""
    if len(cells) != len(header):
        return [], {"": f"should have {format_count(len(header), 'value')}, got {len(cells)}"}
    row = dict(zip(header, cells, strict=True))
    numbers = [_read_number(row[name]) for name in names]
    wrong = {}
    for name, number in zip(names, numbers, strict=True):
        if not math.isfinite(number) and not (may_be_empty(name) and not row[name].strip()):
            expected = "a number, or empty for no target" if may_be_empty(name) else "a number"
            wrong[name] = f"should be {expected}, got {row[name].strip()!r}"
    return numbers, wrong


def _is_number(text: str) -> bool:
    return math.isfinite(_read_number(text))


def _read_number(cell: str) -> float:
    """Read the number in a cell; NaN if it holds none."""
    try:
        return float(cell)
    except ValueError:
        return math.nan
