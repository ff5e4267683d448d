"""NumPy archives: arrays of all samples of a recording, with the offsets of its throws."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from throwcollect.dataset.reader import Dataset
from throwcollect.dataset.sensors import FRAMES
from throwcollect.dataset.throw import Throw
from throwcollect.errors import refuse_argument
from throwcollect.publish.export.exporter import Exporter, Layout, tabulate_signals
from throwcollect.publish.export.throw_source import NO_IMAGES, ExportSource

_LARGEST = 2 * 2**30
"""Size that an array of what a sensor saw may have, as NumPy reads a whole array into memory [bytes]."""


def describe(source: ExportSource) -> Layout:
    """Describe how `write` lays a source out."""
    shard, trial, noun = next(iter(source.shards)), source.throws[0].trial, source.dataset.config.task.noun
    position = f"{source.dataset.config.acted_on}_position_m"
    return Layout(
        files={
            "throws.npz": "one array a column, one element a trial; NaN, -1 or an empty string where there is nothing.",
            "trajectories/": f"one archive a recording. The samples of its k-th {noun}, which is trial `trial[k]`, are "
            "rows `offsets[k]` to `offsets[k + 1]` of each array.",
        },
        loading=f"""\
import numpy as np

throws = np.load("throws.npz")
archive = np.load("trajectories/{shard}.npz")
k = list(archive["trial"]).index({trial})
rows = slice(*archive["offsets"][k : k + 2])
time_s, {position} = archive["time_s"][rows], archive["{position}"][rows]""",
        frames=", ".join(f"`<sensor>_{name}`" for name in FRAMES.values()),
        notes=("`joints` and `moving_joints` name the joints; no array needs `allow_pickle`.",),
        over_time=tabulate_signals(source),
    )


def write(source: ExportSource, directory: Path) -> None:
    """Write a dataset as NumPy archives; see `Exporter.write`."""
    columns = {name: to_array(source.table[name]) for name in source.table.column_names}
    # Objects would be pickled, and every reader would have to allow that.
    plain: dict[str, Any] = {
        name: values.astype(np.str_) if values.dtype == object else values for name, values in columns.items()
    }
    np.savez_compressed(directory / "throws.npz", **plain, digest_of_dataset=np.array(source.dataset.digest))
    (directory / "trajectories").mkdir()
    for shard, throws in source.shards.items():
        _write_shard(source, throws, directory / "trajectories" / f"{shard}.npz")


def to_array(column: pa.ChunkedArray) -> NDArray[Any]:
    """Make an array of a column of the table of throws, texts as objects; a null becomes NaN, -1 or an empty string."""
    if pa.types.is_string(column.type):
        return np.array(column.fill_null("").to_pylist(), dtype=object)
    missing = -1 if pa.types.is_integer(column.type) else np.nan
    array: NDArray[Any] = column.fill_null(missing).to_numpy()
    return array


def _write_shard(source: ExportSource, throws: Dataset, path: Path) -> None:
    ends = np.cumsum([source.count_samples(throw) for throw in throws])
    count, kinds = int(ends[-1]), dict[str, tuple[Any, ...]]()
    with TemporaryDirectory(dir=path.parent) as unpacked:
        # The samples of all throws may be larger than the memory, so they are gathered in files.
        for throw in source.read(throws):
            for name, values in (*throw.signals.items(), *_look(source, throw.throw, count)):
                kinds[name] = values.dtype, (count, *values.shape[1:])
                with Path(unpacked, name).open("ab") as file:
                    file.write(values.tobytes())
        arrays: dict[str, Any] = {
            name: np.memmap(Path(unpacked, name), kind, "r", shape=shape) for name, (kind, shape) in kinds.items()
        }
        np.savez_compressed(
            path,
            trial=throws["trial"],
            offsets=np.concatenate([[0], ends]),
            joints=np.array(source.dataset.joints),
            moving_joints=np.array(source.dataset.moving_joints),
            digest_of_dataset=np.array(source.dataset.digest),
            **arrays,
        )


def _look(source: ExportSource, throw: Throw, samples: int) -> Iterator[tuple[str, NDArray[Any]]]:
    """Read what sensors saw in a throw of a recording with a number of samples: arrays by name."""
    for sensor in source.streams:
        for kind, frames in source.look(throw, sensor).items():
            if (size := frames[:1].nbytes * samples) > _LARGEST:
                problem = f"{sensor}_{kind} of one recording would have {size / 2**30:.1f} GiB"
                expected = f"at most {_LARGEST // 2**30} GiB, a lower rate, or --images {NO_IMAGES}"
                raise refuse_argument("images", problem, expected=expected)
            yield f"{sensor}_{kind}", frames


NPZ = Exporter(describe, write, images={NO_IMAGES: (), "arrays": tuple(FRAMES)})
