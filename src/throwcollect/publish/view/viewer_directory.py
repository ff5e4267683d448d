"""Writes the directory that viewers open: the recording, a bag's metadata, the meshes and a layout."""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from throwcollect.dataset.bag import BAG_SECTION, bag_information, to_yaml
from throwcollect.dataset.directory import METADATA
from throwcollect.dataset.reader import Dataset
from throwcollect.episode.frames import WORLD
from throwcollect.episode.record import Samples
from throwcollect.errors import DatasetError
from throwcollect.files import new_directory
from throwcollect.progress_log import log_progress
from throwcollect.publish.view.markers import ShownThrow
from throwcollect.publish.view.viewer_recording import ViewRecording
from throwcollect.sensing.drawn_robot import draw_robot_of

_SPEED = 0.2
"""Speed of the playback [-]: at real speed a throw is over within a second or two."""


RECORDING = "throws.mcap"
LAYOUT = "foxglove.json"

# Stamps begin above 0: in ROS, a stamp of 0 means the latest transform, and in `ViewRecording` no stamp yet.
_FIRST_NS = 1_000_000_000
_PAUSE_NS = 1_000_000_000
_MOST_PATHS = 1000
"""Most paths that are drawn behind each throw, as one message holds all of them: 7 MB."""


@dataclass(frozen=True)
class View:
    """A directory for viewers that was written, how long its throws take to watch at real speed, and its size."""

    recording: Path
    layout: Path
    throws: int
    duration_s: float
    size_bytes: int


def view(directory: Path, output: Path, trials: Iterable[int] | None = None) -> View:
    """Make throws of a dataset ready for viewers: trials in the given order, or else all that have an episode.

    The directory to write must not exist, or be empty.
    """
    dataset = Dataset.open(directory)
    throws = choose_throws(dataset, trials)
    # The step is rounded up, so that there are never more paths than allowed.
    some = throws[:: -(-len(throws) // _MOST_PATHS)]
    config = dataset.config
    with new_directory(output) as scratch:
        path = scratch / RECORDING
        with path.open("wb") as stream:
            recording = ViewRecording(stream, config)
            paths = [throw for throw, _ in _schedule(some)]
            recording.write(paths, log_progress(_schedule(throws), len(throws), "throw", "written"))
            summary = recording.finish(RECORDING)
        information = {BAG_SECTION: bag_information([summary], recording.channels, {})}
        (scratch / METADATA).write_text(to_yaml(information), encoding="utf-8")
        (scratch / LAYOUT).write_text(json.dumps(_describe_layout(), indent=2) + "\n", encoding="utf-8")
        draw_robot_of(config).copy_package(scratch)
        size = sum(file.stat().st_size for file in scratch.rglob("*") if file.is_file())
    duration_s = (summary.end_ns - summary.start_ns) / 1e9
    return View(output / RECORDING, output / LAYOUT, len(throws), duration_s, size)


def choose_throws(dataset: Dataset, trials: Iterable[int] | None) -> Dataset:
    """Choose the throws that are shown: some trials in their order, or all that have an episode."""
    throws = dataset.recorded if trials is None else dataset.select(trials)
    if not len(throws):
        raise DatasetError("no trial has an episode: there is nothing to show", path=dataset.directory)
    return throws


def _schedule(throws: Dataset) -> Iterator[tuple[ShownThrow, Samples]]:
    """Schedule throws one after another with a pause, regardless of their times in the dataset."""
    start = _FIRST_NS
    for throw in throws:
        _, samples = throw.read_samples()
        yield ShownThrow(throw, throw.config, start, samples.object_position.copy()), samples
        start += int(samples.stamps_ns[-1] - samples.stamps_ns[0]) + _PAUSE_NS


def _describe_layout() -> dict[str, Any]:
    """The layout, as Foxglove imports it: the scene alone."""
    camera = {
        "distance": 4.6,
        "phi": 72.0,
        "thetaOffset": 215.0,
        "targetOffset": [0.5, 0.0, 1.05],
        "near": 0.05,
    }
    ground = {
        "instanceId": "ground",
        "layerId": "foxglove.Grid",
        "label": "Ground",
        "visible": True,
        "frameId": WORLD,
        "size": 10,
        "divisions": 10,
        "lineWidth": 1,
        "color": "#248eff60",
        "order": 1,
    }
    shown = {f"/view/{name}": {"visible": True, "showOutlines": False} for name in ("robot", "tool", "throw", "throws")}
    scene = {
        "followMode": "follow-none",
        "followTf": WORLD,
        "cameraState": camera,
        # The meshes are STL files with z up, as usual in ROS; the default of the application is y.
        "scene": {"meshUpAxis": "z_up", "transforms": {"showLabel": False, "axisScale": 0, "lineWidth": 0}},
        # The description is the same robot, but with paths of mesh files, which not every machine has.
        "topics": {**shown, "/view/path": {"visible": False}, "/robot_description": {"visible": False}},
        "layers": {"ground": ground},
    }
    return {
        "configById": {"3D!throws": scene},
        "globalVariables": {},
        "userNodes": {},
        "playbackConfig": {"speed": _SPEED},
        "layout": "3D!throws",
    }
