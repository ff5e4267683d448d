"""LeRobot datasets, version 3.0 of their format, written without that library."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping
from contextlib import ExitStack, closing
from dataclasses import dataclass
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from numpy.typing import NDArray

from throwcollect.config.sensors import PictureConfig
from throwcollect.dataset.directory import THROWS
from throwcollect.dataset.sensors import FRAMES
from throwcollect.dataset.throw import Throw
from throwcollect.plan.parquet_file import encode_table
from throwcollect.publish.export.exporter import Exporter, Layout, list_joints
from throwcollect.publish.export.images import (
    CODECS,
    MEGABYTES_PER_VIDEO,
    QUANTILES,
    VIDEOS,
    ImageSeries,
    encode_pictures,
    summarise_pictures,
)
from throwcollect.publish.export.parquet import FILES_PER_CHUNK, MEGABYTES_PER_FILE, PATH, ParquetSeries
from throwcollect.publish.export.throw_source import NO_IMAGES, ExportSource, ThrowSeries, unit_of
from throwcollect.robots.surroundings import moving_bodies_of

_VERSION = "v3.0"
_EPISODES_PER_GROUP = 100
_FARTHEST_M = 65.535
"""No depth beyond has a number of millimetres."""

Statistics = dict[str, NDArray[Any]]
"""``min``, ``max``, ``mean``, ``std`` and quantiles of each component; ``count``, the number of frames."""


@dataclass(frozen=True)
class Feature:
    """One feature of the frames of an episode.

    Attributes:
        values: Its values as they are stored, shape ``(n_frames, n_components)``.
        names: Names of its components; None for a scalar.
    """

    values: NDArray[Any]
    names: tuple[str, ...] | None = None

    def as_column(self) -> pa.Array:
        """Make its column in the table of frames."""
        flat = pa.array(self.values.ravel())
        return flat if self.names is None else pa.FixedSizeListArray.from_arrays(flat, len(self.names))

    def as_dict(self) -> dict[str, object]:
        """Make its entry in ``meta/info.json``."""
        names = None if self.names is None else list(self.names)
        # In LeRobot, a scalar has the shape (1,), although its column in the file is no list.
        return {"dtype": self.values.dtype.name, "shape": [len(self.names or ("",))], "names": names}


def describe(source: ExportSource) -> Layout:
    """Describe how `write` lays a source out."""
    config = source.dataset.config
    success, noun = config.task.success, config.task.noun
    longest = max(map(source.count_samples, source.throws))
    return Layout(
        files={
            "data/": "one row a frame.",
            "meta/": "features, statistics, tasks, episodes; `meta/episodes/` has the columns of the table below, too.",
            THROWS: "one row a trial, also of those without episode; `episode_index` numbers its frames.",
        },
        loading=f"""\
from lerobot.datasets.lerobot_dataset import LeRobotDataset

dataset = LeRobotDataset("me/throws", root=".")
{success} = LeRobotDataset("me/throws", root=".", episode_filter=lambda episode: episode["outcome"] == "{success}")""",
        frames="`observation.images.<sensor>`, depths `observation.images.<sensor>_depth` [mm, 0 for none]",
        notes=(
            f"A LeRobot dataset of version {_VERSION.removeprefix('v')}; each episode is a {noun}. Frames are float32. "
            f"The longest episode has {longest} frames: a policy commands all of it at once with "
            f"`--policy.chunk_size={longest} --policy.n_action_steps={longest}` (ACT), asked at {source.rate_hz} Hz.",
        ),
        over_time=[
            "| feature | unit | |",
            "|---|---|---|",
            "| `observation.state` | rad, rad/s | positions (`.pos`), velocities (`.vel`) of moving joints, measured |",
            "| `observation.effort` | N m | torques of their motors |",
            "| `observation.environment_state` | m, m/s | position and velocity of all that moves, in world"
            f"{_describe_goal(source)} |",
            "| `action` | rad | their commanded positions one frame later, on the trajectory sent to controllers |",
            f"| `next.reward` | 1 | 1 in the last frame of a {noun} that succeeded, 0 in all others |",
            f"| `next.success` | | true in the last frame of a {noun} that succeeded |",
            f"| `next.done` | | true in the last frame of a {noun} |",
            "",
            list_joints(source),
        ],
    )


def write(source: ExportSource, directory: Path) -> None:
    """Write a dataset in LeRobot's format; see `Exporter.write`."""
    features: dict[str, Feature] = {}
    totals: dict[str, Statistics] = {}
    tasks: dict[str, int] = {}
    table = _number_episodes(source)
    (directory / THROWS).write_bytes(encode_table(table))
    images = {
        (name, stream): ImageSeries(name, stream, camera, source.images, directory, source.rate_hz)
        for name, camera in source.dataset.config.sensors.items()
        if isinstance(camera, PictureConfig)
        for stream in source.streams.get(name, ())
    }
    with ExitStack() as stack:
        data, meta = (
            stack.enter_context(closing(ParquetSeries(directory / place))) for place in ("data", "meta/episodes")
        )
        for series in images.values():
            stack.enter_context(closing(series))
        throws = source.read(source.throws)
        episodes = table.filter(table["episode_index"].is_valid())
        first = 0
        for start in range(0, len(episodes), _EPISODES_PER_GROUP):
            rows = []
            for number, throw in enumerate(islice(throws, _EPISODES_PER_GROUP), start=start):
                task = _word_task(source, throw.throw)
                index = tasks.setdefault(task, len(tasks))
                features = _compute_features(throw, source, episode=number, first=first, task=index)
                # This comes before the frames are appended, and finds the file that they go to.
                chunk, file = data.place()
                columns = {name: feature.as_column() for name, feature in features.items()}
                table_of_frames = pa.table(columns, metadata={"throwcollect.digest": source.dataset.digest})
                own = {name: _summarise(feature.values.astype(np.float64)) for name, feature in features.items()}
                videos: dict[str, Any] = {}
                seen = {name: source.look(throw.throw, name) for name in source.streams}
                for (name, stream), series in images.items():
                    pictures = seen[name][FRAMES[stream]]
                    if stream == "depth":
                        depth_mm = np.rint(np.where(pictures < _FARTHEST_M, pictures, 0) * 1000)
                        pictures = depth_mm.astype(np.uint16)[..., np.newaxis]
                    own[series.key] = summarise_pictures(pictures)
                    videos |= series.append(pictures)
                    if series.in_table:
                        table_of_frames = table_of_frames.append_column(series.key, encode_pictures(pictures))
                data.append(table_of_frames)
                totals = {name: _combine(totals[name], each) if totals else each for name, each in own.items()}
                row = _describe_episode(own, task, number=number, first=first, chunk=chunk, file=file)
                rows.append(row | videos)
                first += len(throw)
            _append_episodes(meta, rows, episodes.slice(start, len(rows)))
    entries = {name: feature.as_dict() for name, feature in features.items()}
    entries |= {series.key: series.as_feature() for series in images.values()}
    _write_json(directory / "meta" / "info.json", _describe_dataset(source, entries, frames=first, tasks=len(tasks)))
    statistics = {name: {key: values.tolist() for key, values in each.items()} for name, each in totals.items()}
    _write_json(directory / "meta" / "stats.json", statistics)
    pq.write_table(_tabulate_tasks(tasks), directory / "meta" / "tasks.parquet")


def _number_episodes(source: ExportSource) -> pa.Table:
    """Add the number of each trial's episode to the table of throws, behind the number of the trial."""
    numbers = {trial: number for number, trial in enumerate(source.throws["trial"].tolist())}
    field = pa.field(
        "episode_index", pa.int64(), metadata={"description": "Number of its episode; null if it has none."}
    )
    column = pa.array([numbers.get(trial) for trial in source.table["trial"].to_pylist()], pa.int64())
    table = source.table.add_column(1, field, column)
    return table.replace_schema_metadata({"throwcollect.digest": source.dataset.digest})


def _compute_features(
    throw: ThrowSeries, source: ExportSource, *, episode: int, first: int, task: int
) -> dict[str, Feature]:
    """Compute the features of an episode by name, in the order of their columns."""
    count, signals, done, joints = len(throw), throw.signals, throw.done, source.dataset.moving_joints
    moving = [source.dataset.joints.index(joint) for joint in joints]
    index = np.arange(count)
    bodies = moving_bodies_of(source.dataset.config)
    free = [f"{body}_{quantity}" for body in bodies for quantity in ("position_m", "velocity_mps")]
    state = np.hstack([signals[f"joint_{name}"][:, moving] for name in ("position_rad", "velocity_radps")])
    around = np.hstack([signals[name] for name in (*free, *(each.name for each in source.targets))])
    positions = tuple(f"{joint}.pos" for joint in joints)
    parts = (f"{body}.{part}" for body in bodies for part in ("x", "y", "z", "vx", "vy", "vz"))
    goal = (f"target.{each.word.replace(' ', '_')}" for each in source.targets)

    def make(dtype: str, values: NDArray[Any], names: Iterable[str] | None = None) -> Feature:
        return Feature(values.astype(dtype).reshape(count, -1), None if names is None else tuple(names))

    return {
        "observation.state": make("float32", state, (*positions, *(f"{joint}.vel" for joint in joints))),
        "observation.effort": make(
            "float32", signals["joint_effort_nm"][:, moving], (f"{joint}.effort" for joint in joints)
        ),
        "observation.environment_state": make("float32", around, (*parts, *goal)),
        "action": make("float32", throw.find_actions(source.rate_hz), positions),
        "next.reward": make("float32", done * throw.succeeded),
        "next.success": make("bool", done * throw.succeeded),
        "next.done": make("bool", done),
        "timestamp": make("float32", index / source.rate_hz),
        "frame_index": make("int64", index),
        "episode_index": make("int64", np.full(count, episode)),
        "index": make("int64", first + index),
        "task_index": make("int64", np.full(count, task)),
    }


def _describe_episode(
    statistics: Mapping[str, Statistics], task: str, *, number: int, first: int, chunk: int, file: int
) -> dict[str, Any]:
    length = int(statistics["index"]["count"][0])
    row = {
        "episode_index": number,
        "tasks": [task],
        "length": length,
        "data/chunk_index": chunk,
        "data/file_index": file,
        "dataset_from_index": first,
        "dataset_to_index": first + length,
    }
    for name, each in statistics.items():
        row |= {f"stats/{name}/{key}": values.tolist() for key, values in each.items()}
    return row


def _append_episodes(meta: ParquetSeries, rows: list[dict[str, Any]], throws: pa.Table) -> None:
    chunk, file = meta.place()
    places = {"meta/episodes/chunk_index": chunk, "meta/episodes/file_index": file}
    table = pa.Table.from_pylist([{**row, **places} for row in rows])
    for field in throws.drop_columns(["episode_index"]).schema:
        table = table.append_column(field, throws[field.name])
    meta.append(table)


def _describe_dataset(
    source: ExportSource, features: dict[str, dict[str, object]], *, frames: int, tasks: int
) -> dict[str, object]:
    episodes = len(source.throws)
    return {
        "codebase_version": _VERSION,
        "fps": source.rate_hz,
        "features": features,
        "total_episodes": episodes,
        "total_frames": frames,
        "total_tasks": tasks,
        "chunks_size": FILES_PER_CHUNK,
        "data_files_size_in_mb": MEGABYTES_PER_FILE,
        "video_files_size_in_mb": MEGABYTES_PER_VIDEO,
        "data_path": f"data/{PATH}",
        "video_path": VIDEOS if source.streams and source.images in CODECS else None,
        "robot_type": source.dataset.config.robot.name,
        "splits": {"train": f"0:{episodes}"},
    }


def _word_task(source: ExportSource, throw: Throw) -> str:
    """Put into words what the robot is to do, such as ``Throw the ball to x 1.40 m, y -0.20 m``."""
    task = source.dataset.config.task
    words = task.instruction or task.name.replace("_", " ").capitalize()
    goal = [f"{each.word} {throw[each.name]:.2f} {unit_of(each.name)}" for each in source.targets]
    return f"{words} to {', '.join(goal)}." if goal else f"{words}."


def _describe_goal(source: ExportSource) -> str:
    """Name the targets that follow the ball in the state of the environment, as the end of a sentence."""
    goal = [f"{each.word} [{unit_of(each.name)}]" for each in source.targets]
    return f"; then where it should end: {', '.join(goal)}, also in the text of the task" if goal else ""


def _tabulate_tasks(tasks: Mapping[str, int]) -> pa.Table:
    """Make a table with one row for each task, whose words are the index, as pandas stores it."""
    columns = [
        {"name": name, "field_name": name, "pandas_type": kind, "numpy_type": stored, "metadata": None}
        for name, kind, stored in (("task_index", "int64", "int64"), ("task", "unicode", "object"))
    ]
    pandas = {"index_columns": ["task"], "column_indexes": [], "columns": columns}
    return pa.table({"task_index": [*tasks.values()], "task": [*tasks]}).replace_schema_metadata(
        {"pandas": json.dumps(pandas)}
    )


def _summarise(frames: NDArray[np.float64]) -> Statistics:
    """Compute the statistics of the values of a feature, by the names that LeRobot gives them."""
    quantiles = np.quantile(frames, list(QUANTILES.values()), axis=0)
    return {
        "min": frames.min(axis=0),
        "max": frames.max(axis=0),
        "mean": frames.mean(axis=0),
        "std": frames.std(axis=0),
        "count": np.array([len(frames)]),
        **dict(zip(QUANTILES, quantiles, strict=True)),
    }


def _combine(before: Statistics, after: Statistics) -> Statistics:
    """Combine the statistics of two sets of frames, as LeRobot does: quantiles become weighted means of quantiles."""
    count = before["count"] + after["count"]
    share = after["count"] / count
    apart = after["mean"] - before["mean"]
    variance = (1 - share) * before["std"] ** 2 + share * after["std"] ** 2 + share * (1 - share) * apart**2
    return {
        **{key: values + share * (after[key] - values) for key, values in before.items()},
        "min": np.minimum(before["min"], after["min"]),
        "max": np.maximum(before["max"], after["max"]),
        "std": np.sqrt(variance),
        "count": count,
    }


def _write_json(path: Path, value: object) -> None:
    path.write_text(json.dumps(value, indent=4) + "\n", encoding="utf-8")


LEROBOT = Exporter(
    describe, write, images={**dict.fromkeys((*CODECS, "png"), ("color",)), "depth": ("color", "depth"), NO_IMAGES: ()}
)
