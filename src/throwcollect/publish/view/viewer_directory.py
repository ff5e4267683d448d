"""Writes the directory that viewers open: the recording, a bag's metadata, the meshes and a layout."""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from throwcollect.dataset.bag import BAG_SECTION, bag_information, to_yaml
from throwcollect.dataset.directory import METADATA
from throwcollect.dataset.reader import Dataset
from throwcollect.episode.frames import WORLD
from throwcollect.episode.record import Samples
from throwcollect.episode.topics import odometry
from throwcollect.errors import DatasetError
from throwcollect.files import new_directory
from throwcollect.progress_log import log_progress
from throwcollect.publish.view.markers import ShownThrow
from throwcollect.publish.view.viewer_recording import FACTS_HARDWARE, FACTS_NAME, ViewRecording
from throwcollect.sensing.drawn_robot import draw_robot_of

_SCENE = "3D!throws"
_OBJECT = "Plot!object"
_LIMITS = "Plot!limits"
_FACTS = "DiagnosticStatusPanel!facts"
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
    """A directory for viewers that was written, and how long its throws take to watch at real speed [s]."""

    recording: Path
    layout: Path
    throws: int
    messages: int
    duration_s: float
    recording_bytes: int
    mesh_bytes: int


def view(directory: Path, output: Path, trials: Iterable[int] | None = None) -> View:
    """Make throws of a dataset ready for viewers: trials in the given order, or else all that have an episode.

    The directory to write must not exist, or be empty.
    """
    dataset = Dataset.open(directory)
    throws = choose_throws(dataset, trials)
    # The step is rounded up, so that there are never more paths than allowed.
    some = throws[:: -(-len(throws) // _MOST_PATHS)]
    config = dataset.config
    robot = draw_robot_of(config)
    with new_directory(output) as scratch:
        path = scratch / RECORDING
        with path.open("wb") as stream:
            recording = ViewRecording(stream, config)
            paths = [throw for throw, _ in _schedule(some)]
            recording.write(paths, log_progress(_schedule(throws), len(throws), "throw", "written"))
            summary = recording.finish(RECORDING)
        information = {BAG_SECTION: bag_information([summary], recording.channels, {})}
        (scratch / METADATA).write_text(to_yaml(information), encoding="utf-8")
        (scratch / LAYOUT).write_bytes(layout(tuple(config.task.end), config.acted_on))
        robot.copy_package(scratch)
        mesh_bytes = sum(file.stat().st_size for file in robot.meshes.values())
        recording_bytes = path.stat().st_size
    return View(
        recording=output / RECORDING,
        layout=output / LAYOUT,
        throws=len(throws),
        messages=summary.messages,
        duration_s=(summary.end_ns - summary.start_ns) / 1e9,
        recording_bytes=recording_bytes,
        mesh_bytes=mesh_bytes,
    )


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


def layout(joints: Sequence[str], body: str) -> bytes:
    """JSON text of the layout, as applications import it, with plots of the limits of joints, and of the object."""
    shares = [_describe_series(f"/view/limits.position[{index}]", joint) for index, joint in enumerate(joints)]
    height = _describe_series(f"{odometry(body).name}.pose.pose.position.z", "height [m]")
    panels = {
        _SCENE: _describe_scene(),
        _OBJECT: _describe_plot(
            [height, _describe_series("/view/object_speed.data", "speed [m/s]")], body.capitalize()
        ),
        _LIMITS: _describe_plot(
            [*shares, _describe_series("-1", "lower limit"), _describe_series("1", "upper limit")],
            "Joint positions within their limits",
        ),
        _FACTS: {"topicToRender": "/view/facts", "selectedHardwareId": FACTS_HARDWARE, "selectedName": FACTS_NAME},
    }
    document = {
        "configById": panels,
        "globalVariables": {},
        "userNodes": {},
        "playbackConfig": {"speed": _SPEED},
        "layout": _describe_split(
            "row", _SCENE, _describe_split("column", _FACTS, _describe_split("column", _OBJECT, _LIMITS, 50), 34), 64
        ),
    }
    return (json.dumps(document, indent=2) + "\n").encode()


def _describe_scene() -> dict[str, Any]:
    camera = {
        "perspective": True,
        "distance": 4.6,
        "phi": 72.0,
        "thetaOffset": 215.0,
        "target": [0.0, 0.0, 0.0],
        "targetOffset": [0.5, 0.0, 1.05],
        "targetOrientation": [0, 0, 0, 1],
        "fovy": 45,
        "near": 0.05,
        "far": 500,
    }
    layers = {
        "ground": {
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
        },
    }
    return {
        "followMode": "follow-none",
        "followTf": WORLD,
        "cameraState": camera,
        # The meshes are STL files with z up, as usual in ROS; the default of the application is y.
        "scene": {"meshUpAxis": "z_up", "transforms": {"showLabel": False, "axisScale": 0, "lineWidth": 0}},
        "topics": {
            "/view/robot": {"visible": True, "showOutlines": False},
            "/view/tool": {"visible": True, "showOutlines": False},
            "/view/throw": {"visible": True, "showOutlines": False},
            "/view/throws": {"visible": True, "showOutlines": False},
            "/view/path": {"visible": False},
            # This is the same robot, but with paths of mesh files, which not every machine has.
            "/robot_description": {"visible": False},
        },
        "layers": layers,
    }


def _describe_plot(paths: Sequence[Mapping[str, Any]], title: str) -> dict[str, Any]:
    return {
        # Lichtblick, which began as a copy of Foxglove, uses another key for the title.
        "foxglovePanelTitle": title,
        "lichtblickPanelTitle": title,
        "paths": list(paths),
        "showLegend": True,
        "legendDisplay": "left",
        "sidebarDimension": 190,
        "showPlotValuesInLegend": False,
        "showXAxisLabels": True,
        "showYAxisLabels": True,
        "isSynced": True,
        "xAxisVal": "timestamp",
    }


def _describe_series(value: str, label: str) -> dict[str, Any]:
    return {"value": value, "label": label, "enabled": True, "timestampMethod": "receiveTime"}


def _describe_split(direction: str, first: Any, second: Any, percentage: int) -> dict[str, Any]:
    return {"direction": direction, "first": first, "second": second, "splitPercentage": percentage}
