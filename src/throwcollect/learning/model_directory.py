"""The directory of a model: its JSON file, the throws that it was learned from, and a card for people."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray
from pydantic import ValidationError

from throwcollect.errors import DatasetError
from throwcollect.files import new_directory, read_text, write_file
from throwcollect.learning.distilling import ONNX, encode_onnx
from throwcollect.learning.fitting import EFFORT
from throwcollect.learning.learned_map import LearnedMap
from throwcollect.learning.model_card import describe_model
from throwcollect.learning.model_file import MODEL, ModelFile, read_model_file
from throwcollect.learning.score import Score
from throwcollect.sweep.parquet_file import encode_table, read_parquet

POINTS = "points.parquet"
"""File with parameters, ends and efforts of the throws, from which aiming begins."""
CONFIG = "config.yaml"
SCORE = "score.json"
CARD = "README.md"
_MOST_BYTES = 10_000_000


def write_model(directory: Path, file: ModelFile, learned: LearnedMap, trials: NDArray[np.int64], config: str) -> None:
    """Write a model, given in the parts that `read_model` returns, into a directory that is new or empty."""
    columns: dict[str, NDArray[Any]] = {"trial": trials}
    columns |= {axis.key: learned.values[:, number] for number, axis in enumerate(learned.axes)}
    columns |= {target: learned.outputs[:, number] for number, target in enumerate(learned.targets)}
    onnx = None if file.distilled is None else encode_onnx(learned, file.distilled)
    with new_directory(directory) as beside:
        write_file(beside / MODEL, (file.model_dump_json(indent=1) + "\n").encode())
        write_file(beside / POINTS, encode_table(pa.table({**columns, EFFORT: learned.efforts})))
        write_file(beside / CONFIG, config.encode())
        write_file(beside / CARD, describe_model(file, None).encode())
        if onnx is not None:
            write_file(beside / ONNX, onnx)


def read_model(directory: Path) -> tuple[ModelFile, LearnedMap, NDArray[np.int64], str]:
    """Read a model.

    Returns:
        The model without its throws; the map with the throws; numbers of their trials, shape ``(n,)``; YAML of the
        dataset's configuration.
    """
    file = read_model_file(directory)
    path = directory / POINTS
    table = read_parquet(path)
    names = {"trial", *(axis.key for axis in file.axes), *file.targets, EFFORT}
    if set(table.column_names) != names:
        raise DatasetError("does not have the columns of this model", path=path, expected=", ".join(sorted(names)))
    columns = {name: table[name].to_numpy() for name in table.column_names}
    learned = LearnedMap(
        file.kind,
        file.axes,
        file.targets,
        file.forward,
        file.effort,
        np.column_stack([columns[axis.key] for axis in file.axes]),
        np.column_stack([columns[target] for target in file.targets]),
        columns[EFFORT],
        file.correction,
    )
    return file, learned, columns["trial"], read_text(directory / CONFIG, most_bytes=_MOST_BYTES)


def write_score(directory: Path, score: Score) -> None:
    """Write a score into the directory of a model, in place of an earlier one, and into the model's card."""
    file = read_model_file(directory)
    write_file(directory / SCORE, (score.model_dump_json(indent=1) + "\n").encode())
    write_file(directory / CARD, describe_model(file, score).encode())


def read_score(directory: Path) -> Score | None:
    """Read the score of a model from its directory; None if it has none."""
    path = directory / SCORE
    if not path.exists():
        return None
    try:
        return Score.model_validate_json(read_text(path, most_bytes=_MOST_BYTES))
    except ValidationError as error:
        raise DatasetError(f"is no score of a model: {error.errors()[0]['msg']}", path=path) from error
