"""NumPy archives: arrays of all samples of a recording, with the offsets of its throws."""

from __future__ import annotations

import shutil
import zipfile
from collections.abc import Iterator, Mapping
from contextlib import ExitStack
from pathlib import Path
from typing import IO, Any

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from throwcollect.dataset.reader import Dataset
from throwcollect.dataset.sensors import FRAMES
from throwcollect.dataset.throw import Throw
from throwcollect.errors import refuse_argument
from throwcollect.publish.export.exporter import Exporter, Layout, tabulate_signals
from throwcollect.publish.export.throw_source import NO_IMAGES, ExportSource

_EPOCH = (1980, 1, 1, 0, 0, 0)
"""A fixed date for the members of archives, so that the same data give the same bytes."""
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
    columns = {field.name: to_array(source.table[field.name]) for field in source.table.schema}
    with zipfile.ZipFile(directory / "throws.npz", "w") as archive:
        for name, values in {**columns, "digest_of_dataset": np.array(source.dataset.digest)}.items():
            _add(archive, name, values)
    (directory / "trajectories").mkdir()
    for shard, entries in source.shards.items():
        _write_shard(source, entries, directory / "trajectories" / f"{shard}.npz")


def to_array(column: pa.ChunkedArray) -> NDArray[Any]:
    """Make an array of a column of the table of throws, texts as objects; a null becomes NaN, -1 or an empty string."""
    if pa.types.is_string(column.type):
        return np.array(column.fill_null("").to_pylist(), dtype=object)
    missing = -1 if pa.types.is_integer(column.type) else np.nan
    array: NDArray[Any] = column.fill_null(missing).to_numpy()
    return array


def _write_shard(source: ExportSource, throws: Dataset, path: Path) -> None:
    offsets = np.concatenate([[0], np.cumsum([source.count_samples(throw) for throw in throws])])
    names: Mapping[str, NDArray[Any]] = {
        "trial": throws["trial"],
        "offsets": offsets,
        "joints": np.array(source.dataset.joints),
        "moving_joints": np.array(source.dataset.moving_joints),
        "digest_of_dataset": np.array(source.dataset.digest),
    }
    # A member of an archive has to be written in one go, so each array is first written to a file of its own.
    unpacked: dict[str, Path] = {}
    with ExitStack() as stack:
        files: dict[str, IO[bytes]] = {}
        for throw in source.read(throws):
            for name, values in (*throw.signals.items(), *_look(source, throw.throw, int(offsets[-1]))):
                if name not in files:
                    unpacked[name] = path.with_name(f"{path.stem}.{name}.npy")
                    files[name] = stack.enter_context(unpacked[name].open("wb"))
                    kind, shape = np.lib.format.dtype_to_descr(values.dtype), (int(offsets[-1]), *values.shape[1:])
                    header = {"descr": kind, "fortran_order": False, "shape": shape}
                    np.lib.format.write_array_header_1_0(files[name], header)
                files[name].write(values.tobytes())
    with zipfile.ZipFile(path, "w") as archive:
        for name, values in names.items():
            _add(archive, name, values)
        for name, file_of_signal in unpacked.items():
            # `zipfile` does not know the size beforehand, and fails at 2 GiB unless `force_zip64` is set.
            with file_of_signal.open("rb") as array, archive.open(_make_member(name), "w", force_zip64=True) as packed:
                shutil.copyfileobj(array, packed)
            file_of_signal.unlink()


def _look(source: ExportSource, throw: Throw, samples: int) -> Iterator[tuple[str, NDArray[Any]]]:
    """Read what sensors saw in a throw of a recording with a number of samples: arrays by name."""
    for sensor in source.streams:
        for kind, frames in source.look(throw, sensor).items():
            if (size := frames[:1].nbytes * samples) > _LARGEST:
                problem = f"{sensor}_{kind} of one recording would have {size / 2**30:.1f} GiB"
                expected = f"at most {_LARGEST // 2**30} GiB, a lower rate, or --images {NO_IMAGES}"
                raise refuse_argument("images", problem, expected=expected)
            yield f"{sensor}_{kind}", frames


def _add(archive: zipfile.ZipFile, name: str, values: NDArray[Any]) -> None:
    # Objects would be pickled, and every reader would have to allow that.
    stored = values.astype(np.str_) if values.dtype == object else values
    with archive.open(_make_member(name), "w") as file:
        np.lib.format.write_array(file, stored, allow_pickle=False)


def _make_member(name: str) -> zipfile.ZipInfo:
    member = zipfile.ZipInfo(f"{name}.npy", _EPOCH)
    member.compress_type = zipfile.ZIP_DEFLATED
    return member


NPZ = Exporter(describe, write, images={NO_IMAGES: (), "arrays": tuple(FRAMES)})
