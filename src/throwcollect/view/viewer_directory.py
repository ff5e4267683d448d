"""Writes the directory that viewers open: the recording, a bag's metadata, the meshes and a layout."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from throwcollect.dataset.bag import BAG_SECTION, bag_information, to_yaml
from throwcollect.dataset.damage import read_samples
from throwcollect.dataset.directory import METADATA
from throwcollect.dataset.reader import Dataset
from throwcollect.episode.record import Samples
from throwcollect.files import new_directory
from throwcollect.progress_log import log_progress
from throwcollect.view.drawn_robot import draw_robot_of
from throwcollect.view.foxglove import layout
from throwcollect.view.shown_throws import ShownThrow, choose_throws
from throwcollect.view.viewer_recording import ViewRecording

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

    def as_dict(self) -> dict[str, Any]:
        """The same for JSON."""
        return {**asdict(self), "recording": str(self.recording), "layout": str(self.layout)}


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
    with new_directory(output) as beside:
        path = beside / RECORDING
        with path.open("wb") as stream:
            recording = ViewRecording(stream, config)
            paths = [throw for throw, _ in _schedule(dataset, some)]
            recording.write(paths, log_progress(_schedule(dataset, throws), len(throws), "throw", "written"))
            summary = recording.finish(RECORDING)
        information = {BAG_SECTION: bag_information([summary], recording.channels, {})}
        (beside / METADATA).write_text(to_yaml(information), encoding="utf-8")
        (beside / LAYOUT).write_bytes(layout(tuple(config.task.end)))
        robot.copy_package(beside)
        mesh_bytes = sum((beside / mesh).stat().st_size for mesh in robot.meshes)
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


def _schedule(dataset: Dataset, throws: Dataset) -> Iterator[tuple[ShownThrow, Samples]]:
    """Schedule throws one after another with a pause, regardless of their times in the dataset."""
    start = _FIRST_NS
    for throw in throws:
        _, samples = read_samples(dataset, throw.trial)
        config = dataset.plan.config_of(dataset.plan.trial(throw.trial))
        yield ShownThrow(throw.row, config, start, samples.ball_position.copy()), samples
        start += int(samples.stamps_ns[-1] - samples.stamps_ns[0]) + _PAUSE_NS
