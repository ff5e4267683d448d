"""HDF5 in the layout of robomimic: one group a throw, with observations, actions, rewards and dones."""

from __future__ import annotations

import io
import json
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from throwcollect.extras import lazily
from throwcollect.files import write_all
from throwcollect.own_process import count_interruptions
from throwcollect.publish.export.exporter import Exporter, Layout, tabulate_signals
from throwcollect.publish.export.npz import to_array
from throwcollect.publish.export.throw_source import NO_IMAGES, ExportSource, Signal, ThrowSeries, read_metadata

h5py = lazily("h5py")

_COMMAND = "command_position_rad"
_OTHERS = ("time_s", _COMMAND, "command_velocity_radps", "command_acceleration_radps2")
"""Signals that are neither an observation nor an action, so they are stored next to both."""
_LATER = " One sample later."
_COMPRESSION = {"compression": "gzip", "compression_opts": 1, "shuffle": True}
_CAMERAS = {"images": ("image", "1"), "depth_m": ("depth", "m")}
"""What robomimic calls what a camera sees, and the unit of that."""
_GYM = 2
"""robomimic's number for environments that are not of robosuite."""


def describe(source: ExportSource) -> Layout:
    """Describe how `write` lays a source out."""
    config, task = source.dataset.config, source.dataset.config.task
    noun, position = task.noun, f"{config.acted_on}_position_m"
    success, measure = task.success, next(iter(task.targets), "outcome")
    return Layout(
        files={
            "throws.hdf5": f"the {noun} of trial N is the group `data/demo_N`; "
            f"`mask/{success}` lists those that succeeded; "
            "`throws/` is the table of all trials, one dataset a column, with NaN, -1 or an empty string where there "
            "is nothing.",
        },
        loading=f"""\
import h5py

file = h5py.File("throws.hdf5")
{position} = file["data/demo_{source.throws[0].trial}/obs/{position}"][:]
{measure} = file["throws/{measure}"][:]""",
        frames="`obs/<sensor>_image` [0 to 255] and `obs/<sensor>_depth` [m], each with the next ones in `next_obs/`",
        notes=(
            f"The layout is that of robomimic. Each group of a {noun} has `obs/` with what is measured, `next_obs/`, "
            "the same one sample later, `actions`, the commanded positions of the moving joints one sample later, "
            f"`rewards`, 1 in the last sample of a {noun} that succeeded, and `dones`, 1 in the last sample. Every "
            "dataset has the attributes `unit` and `description`, and `components` where it has several columns.",
        ),
        over_time=tabulate_signals(source),
    )


def write(source: ExportSource, directory: Path) -> None:
    """Write a dataset as one HDF5 file; see `Exporter.write`."""
    config = source.dataset.config
    # The HDF5 library goes on after an exception in one of the output's methods, without what should have been written.
    with (
        count_interruptions() as interruptions,
        _Output(directory / "throws.hdf5") as output,
        h5py.File(output, "w") as file,
    ):
        file.attrs["digest_of_dataset"] = source.dataset.digest
        file.attrs["rate_hz"] = source.rate_hz
        data = file.create_group("data")
        data.attrs["total"] = sum(map(source.count_samples, source.throws))
        data.attrs["env_args"] = json.dumps({"env_name": config.name, "type": _GYM, "env_kwargs": {}})
        placed = config.with_files_in(Path()).model_copy(update={"robot": config.robot.without_place()})
        file.attrs["config"] = placed.model_dump_json()
        succeeded = []
        for throw in source.read(source.throws):
            name = f"demo_{throw.throw.trial}"
            _add_throw(data.create_group(name), throw, source)
            succeeded += [name] * throw.succeeded
            output.check()
            if interruptions():
                raise KeyboardInterrupt
        file[f"mask/{config.task.success}"] = np.array(succeeded, dtype="S")
        table = file.create_group("throws")
        for field in source.table.schema:
            column = to_array(source.table[field.name])
            kind = h5py.string_dtype() if column.dtype == object else None
            table.create_dataset(field.name, data=column, dtype=kind).attrs.update(read_metadata(field))


class _Output(io.FileIO):
    """A file that keeps write errors until `check` raises them: the HDF5 library crashes if a write raises one."""

    def __init__(self, path: Path) -> None:
        # HDF5 also reads what it has written.
        super().__init__(path, "w+")
        self._error: OSError | None = None

    def write(self, data: Any) -> int:
        try:
            write_all(self.fileno(), data)
        except OSError as error:
            self._error = self._error or error
        return len(data)

    def truncate(self, size: int | None = None) -> int:
        try:
            return super().truncate(size)
        except OSError as error:
            self._error = self._error or error
            return size or 0

    def flush(self) -> None:
        """Do nothing, as `write` holds nothing back."""

    def check(self) -> None:
        """Raise the first write error so far."""
        if self._error is not None:
            raise self._error

    def __exit__(self, kind: type[BaseException] | None, *rest: Any) -> None:
        super().__exit__(kind, *rest)
        # HDF5 may have raised an error of its own by now, whose cause is the error that was kept.
        self.check()


def _add_throw(group: Any, throw: ThrowSeries, source: ExportSource) -> None:
    group.attrs["num_samples"] = len(throw)
    group.attrs["trial"] = throw.throw.trial
    group.attrs[source.dataset.config.task.success] = throw.succeeded
    group["dones"] = throw.done.astype(np.int64)
    group["rewards"] = throw.done * throw.succeeded
    for signal in source.signals:
        values = throw.signals[signal.name]
        if signal.name in _OTHERS:
            _add_signal(group, signal.name, signal, values)
        else:
            _add_signal(group, f"obs/{signal.name}", signal, values)
            # As in robomimic's own conversions, the last observation is repeated.
            _add_signal(group, f"next_obs/{signal.name}", signal, np.concatenate([values[1:], values[-1:]]), _LATER)
        if signal.name == _COMMAND:
            _add_signal(group, "actions", signal, throw.find_actions(source.rate_hz), _LATER)
    for name in source.streams:
        for kind, frames in source.look(throw.throw, name).items():
            ending, unit = _CAMERAS[kind]
            _add_frames(group, f"{name}_{ending}", frames.reshape(*frames.shape[:3], -1), unit)


def _add_frames(group: Any, name: str, frames: NDArray[Any], unit: str) -> None:
    stored = group.create_dataset(f"obs/{name}", data=frames, chunks=(1, *frames.shape[1:]), **_COMPRESSION)
    described = {"unit": unit, "description": f"What the camera sees, of shape {frames.shape[1:]} in each sample."}
    stored.attrs.update(described)
    # What is seen one sample later is a view of this, because it would double the size of the file.
    seen = h5py.VirtualSource(".", stored.name, frames.shape, stored.dtype)
    later = h5py.VirtualLayout(frames.shape, stored.dtype)
    later[:-1], later[-1] = seen[1:], seen[-1]
    following = group.create_virtual_dataset(f"next_obs/{name}", later)
    following.attrs.update({**described, "description": described["description"] + _LATER})


def _add_signal(group: Any, name: str, signal: Signal, values: NDArray[np.float64], when: str = "") -> None:
    stored = group.create_dataset(name, data=values, **_COMPRESSION)
    stored.attrs["unit"] = signal.unit
    stored.attrs["description"] = signal.description + when
    if signal.components:
        stored.attrs["components"] = list(signal.components)


HDF5 = Exporter(describe, write, packages=("h5py",), images={"arrays": ("color", "depth"), NO_IMAGES: ()})
