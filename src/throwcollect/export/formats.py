"""The formats that datasets are exported to, and the one way to do it."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from throwcollect.dataset.directory import CARD, CONFIG
from throwcollect.dataset.new_directory import new_directory
from throwcollect.errors import ConfigError
from throwcollect.export import hdf5, lerobot, mat, npz, parquet
from throwcollect.export.readme import Layout, card
from throwcollect.export.throw_source import Source


@dataclass(frozen=True)
class Format:
    """One format.

    Attributes:
        write: Writes the data files of a source into a directory. Raises `DatasetError` if an episode is damaged or
            what it writes would be too large for the format, `ConfigError` if a library that it needs is not
            installed, `OSError` if a file cannot be written.
        layout: Says how they are laid out.
    """

    write: Callable[[Source, Path], None]
    layout: Callable[[Source], Layout]


FORMATS = {
    "parquet": Format(parquet.write, parquet.layout),
    "npz": Format(npz.write, npz.layout),
    "lerobot": Format(lerobot.write, lerobot.layout),
    "hdf5": Format(hdf5.write, hdf5.layout),
    "mat": Format(mat.write, mat.layout),
}


@dataclass(frozen=True)
class Exported:
    """What was exported.

    Attributes:
        directory: Where to.
        format: In which format.
        trials: Number of trials, each with a row of the table.
        episodes: Number of throws with time series.
        samples: Number of their samples.
        rate_hz: Samples per second.
        size_bytes: Size of all files.
        digest: Digest of the source.
    """

    directory: str
    format: str
    trials: int
    episodes: int
    samples: int
    rate_hz: int
    size_bytes: int
    digest: str


def export(directory: Path, output: Path, *, to: str, rate_hz: int | None = None) -> Exported:
    """Write a dataset in another format, with a data card and its configuration.

    Args:
        directory: The dataset.
        output: Directory to write; must be new or empty. Nothing is left there on failure.
        to: One of `FORMATS`.
        rate_hz: Samples per second; the recorded ones when None.

    Raises:
        ConfigError: If there is no such format, the rate is above the recorded one, `output` exists, or a library that
            the format needs is not installed.
        DatasetError: If the dataset is unfinished, damaged or without episodes, or `output` cannot be written.
    """
    if to not in FORMATS:
        raise ConfigError(f"--to: unknown format {to!r}", expected=f"one of {', '.join(FORMATS)}")
    chosen = FORMATS[to]
    source = Source.open(directory, rate_hz=rate_hz)
    with new_directory(output) as beside:
        chosen.write(source, beside)
        shutil.copyfile(directory / CONFIG, beside / CONFIG)
        (beside / CARD).write_text(card(source, chosen.layout(source)), encoding="utf-8")
        size = sum(path.stat().st_size for path in beside.rglob("*") if path.is_file())
    return Exported(
        directory=str(output),
        format=to,
        trials=len(source.table),
        episodes=len(source.entries),
        samples=sum(entry.samples for entry in source.entries),
        rate_hz=source.rate_hz,
        size_bytes=size,
        digest=source.digest,
    )
