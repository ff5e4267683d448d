"""The way into a dataset from Python, which costs nothing until it is taken."""

from __future__ import annotations

import os
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from throwcollect.dataset.throw_dataset import ThrowDataset


def load(directory: str | os.PathLike[str]) -> ThrowDataset:
    """Open a finished dataset for reading.

    Its tables are read and checked against each other; recordings are opened when they are looked at.

    Args:
        directory: Its directory.

    Raises:
        DatasetError: If the directory holds no dataset, an unfinished one, or one whose tables are damaged.
        ConfigError: If its ``config.yaml`` is wrong.
    """
    from throwcollect.dataset.throw_dataset import load_dataset

    return load_dataset(directory)
