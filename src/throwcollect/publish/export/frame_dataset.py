"""All frames of a dataset by number, for training: what a policy observes, and what it should do."""

from __future__ import annotations

from collections.abc import Collection
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from throwcollect.dataset.reader import Dataset, load
from throwcollect.dataset.sensors import FRAMES, Frames
from throwcollect.errors import check_bounds, refuse_argument
from throwcollect.files import StrPath
from throwcollect.publish.export.throw_source import ExportSource, choose_streams
from throwcollect.wording import suggest

_ENDINGS = {"color": "image", "depth": "depth"}


class FrameDataset:
    """The frames of all recorded throws, one after the other, as the ``DataLoader`` of PyTorch takes them.

    A frame is a dictionary of NumPy arrays with the names that exports and policies have: signals, such as
    ``joint_position_rad``, in float32; ``<camera>_image``, uint8 of shape ``(height, width, 3)``; ``<camera>_depth``
    [m], float32 of shape ``(height, width, 1)``, inf where nothing is near enough and NaN where noise has dropped it;
    ``action``, the positions of the moving joints [rad] that are commanded one frame later, float32; and the number of
    its ``trial``. May be sent to other processes.

    Args:
        dataset: Directory of a dataset, or what `load` gave, or a part of that.
        observation: Names of the signals and of what cameras saw; all if it is empty.
        rate_hz: Frames per second; by default the largest number at which each has a frame of each camera.
        horizon: If it is above 0, ``action`` has so many rows, the first that of the frame itself. After the end of the
            throw, the last one is repeated.

    Raises:
        ConfigError: If there is no such observation, or not all cameras have frames at this rate.
        DatasetError: If the directory holds no dataset, or none of its throws has an episode.
    """

    def __init__(
        self,
        dataset: Dataset | StrPath,
        *,
        observation: Collection[str] = (),
        rate_hz: int | None = None,
        horizon: int = 0,
    ) -> None:
        check_bounds("horizon", horizon, least=0)
        dataset = dataset if isinstance(dataset, Dataset) else load(dataset)
        streams = choose_streams(dataset.config, _ENDINGS)
        seen = {f"{name}_{_ENDINGS[each]}": (name, FRAMES[each]) for name, some in streams.items() for each in some}
        self._seen = {name: found for name, found in seen.items() if name in (observation or seen)}
        chosen = {name: streams[name] for name, _ in self._seen.values()}
        self._source, self._horizon = ExportSource(dataset, chosen, rate_hz=rate_hz), horizon
        known = [*(signal.name for signal in self._source.signals), *seen]
        for name in set(observation).difference(known):
            raise refuse_argument("observation", f"there is no {name!r}{suggest(name, known)}")
        self._signals = [name for name in observation or known if name not in seen]
        self._ends = np.cumsum([*map(self._source.count_samples, self._source.throws)])
        self._opened: tuple[int, dict[str, Any]] | None = None

    def __getstate__(self) -> dict[str, Any]:
        return {**vars(self), "_opened": None}

    def __len__(self) -> int:
        return int(self._ends[-1])

    def __getitem__(self, index: int) -> dict[str, Any]:
        number = range(len(self))[index]
        throw = int(np.searchsorted(self._ends, number, side="right"))
        opened = self._opened
        with self._source.throws[throw].locating_damage():
            if opened is None or opened[0] != throw:
                self._opened = opened = throw, self._open(throw)
            # Counted from the end of the throw; a frame is the caller's own.
            return {name: series[number - self._ends[throw]].copy() for name, series in opened[1].items()}

    def _open(self, number: int) -> dict[str, Any]:
        """Open a throw: all that frames have, with the frame as the first axis."""
        throw, rate_hz = self._source.throws[number], self._source.rate_hz
        series = self._source.read_throw(throw)
        rows, actions = np.arange(len(series)), series.find_actions(rate_hz).astype(np.float32)
        if self._horizon:
            actions = actions[np.minimum(rows[:, np.newaxis] + np.arange(self._horizon), rows[-1])]
        found: dict[str, Any] = {"action": actions, "trial": np.full(len(rows), throw.trial)}
        for name in self._signals:
            found[name] = series.signals[name].astype(np.float32).reshape(len(rows), -1)
        for name, (sensor, kind) in self._seen.items():
            step = throw.sensors[sensor].config.rate_hz // rate_hz
            found[name] = Frames(len(rows), partial(_find_frame, getattr(throw.sensors[sensor], kind), step))
        return found


def _find_frame(frames: Frames, step: int, number: int) -> NDArray[Any]:
    frame: NDArray[Any] = frames[number * step]
    return frame.reshape(*frame.shape[:2], -1)
