"""The exported files have the LeRobot format, and the lerobot library reads them where it is installed."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from tests.unit.publish.export.conftest import (
    HELD,
    MOVING,
    WITH_EPISODE,
    Arrays,
    Export,
    actions_of,
    moving_columns,
    table_of,
    throws_of,
)

import throwcollect
from throwcollect.dataset.inspect import info
from throwcollect.publish.export import parquet
from throwcollect.publish.export.export import export

POSITIONS = [f"{joint}.pos" for joint in MOVING]
FLOATS = {
    "observation.state": POSITIONS + [f"{joint}.vel" for joint in MOVING],
    "observation.effort": [f"{joint}.effort" for joint in MOVING],
    "observation.environment_state": ["ball.x", "ball.y", "ball.z", "ball.vx", "ball.vy", "ball.vz"],
    "action": POSITIONS,
}
SCALARS = {
    "next.reward": "float32",
    "next.success": "bool",
    "next.done": "bool",
    "timestamp": "float32",
    "frame_index": "int64",
    "episode_index": "int64",
    "index": "int64",
    "task_index": "int64",
}
STATISTICS = ["min", "max", "mean", "std", "count", "q01", "q10", "q50", "q90", "q99"]
SCALAR_TYPES = {"float32": pa.float32(), "bool": pa.bool_(), "int64": pa.int64()}


def frames_of(source: Path, step: int = 1, rate_hz: int = 250) -> list[Arrays]:
    """Features of each episode, straight from the recordings, as they should be stored."""
    moving = moving_columns()
    episodes: list[Arrays] = []
    first = 0
    throws = zip(throws_of(source, step), actions_of(source, step), strict=True)
    for number, ((trial, signals), actions) in enumerate(throws):
        count = len(signals["time_s"])
        last = np.arange(count) == count - 1
        episodes.append(
            {
                "observation.state": np.hstack(
                    [signals["joint_position_rad"][:, moving], signals["joint_velocity_radps"][:, moving]]
                ).astype(np.float32),
                "observation.effort": signals["joint_effort_nm"][:, moving].astype(np.float32),
                "observation.environment_state": np.hstack(
                    [signals["ball_position_m"], signals["ball_velocity_mps"]]
                ).astype(np.float32),
                "action": actions.astype(np.float32),
                "next.reward": (last * (trial != HELD)).astype(np.float32),
                "next.success": last & (trial != HELD),
                "next.done": last,
                "timestamp": (np.arange(count) / rate_hz).astype(np.float32),
                "frame_index": np.arange(count),
                "episode_index": np.full(count, number),
                "index": first + np.arange(count),
                "task_index": np.zeros(count, np.int64),
            }
        )
        first += count
    return episodes


def join(episodes: list[Arrays]) -> Arrays:
    return {name: np.concatenate([episode[name] for episode in episodes]) for name in episodes[0]}


def values_of(column: pa.ChunkedArray) -> np.ndarray:
    return np.array(column.to_pylist())


def test_the_info_file_has_the_contents_that_the_lerobot_format_prescribes(exported: Export, source: Path) -> None:
    described = {
        name: {"dtype": "float32", "shape": [len(names)], "names": names} for name, names in FLOATS.items()
    } | {name: {"dtype": kind, "shape": [1], "names": None} for name, kind in SCALARS.items()}
    assert json.loads((exported("lerobot") / "meta" / "info.json").read_text()) == {
        "codebase_version": "v3.0",
        "robot_type": "talos",
        "total_episodes": 4,
        "total_frames": info(source).samples,
        "total_tasks": 1,
        "chunks_size": 1000,
        "data_files_size_in_mb": 100,
        "video_files_size_in_mb": 200,
        "fps": 250,
        "splits": {"train": "0:4"},
        "data_path": "data/chunk-{chunk_index:03d}/file-{file_index:03d}.parquet",
        "video_path": None,
        "features": described,
    }


@pytest.mark.parametrize(("rate_hz", "step"), [(None, 1), (50, 5)])
def test_exported_frames_equal_the_samples_of_the_dataset(
    rate_hz: int | None, step: int, exported: Export, source: Path
) -> None:
    table = pq.read_table(exported("lerobot", rate_hz) / "data" / "chunk-000" / "file-000.parquet")
    types = {name: pa.list_(pa.float32(), len(names)) for name, names in FLOATS.items()}
    types |= {name: SCALAR_TYPES[kind] for name, kind in SCALARS.items()}
    assert dict(zip(table.schema.names, table.schema.types, strict=True)) == types
    for name, values in join(frames_of(source, step, rate_hz or 250)).items():
        assert np.array_equal(values_of(table[name]), values), name


def test_every_episode_is_one_row_group(exported: Export) -> None:
    with pq.ParquetFile(exported("lerobot") / "data" / "chunk-000" / "file-000.parquet") as file:
        groups = [file.read_row_group(number)["episode_index"].to_pylist() for number in range(file.num_row_groups)]
    assert [set(group) for group in groups] == [{0}, {1}, {2}, {3}]


def test_the_episode_table_has_the_place_and_the_results_of_every_episode(exported: Export, source: Path) -> None:
    table = pq.read_table(exported("lerobot") / "meta" / "episodes" / "chunk-000" / "file-000.parquet")
    frames, throws = frames_of(source), table_of(source)
    places = ["episode_index", "tasks", "length", "data/chunk_index", "data/file_index", "dataset_from_index"]
    places += ["dataset_to_index", "meta/episodes/chunk_index", "meta/episodes/file_index"]
    statistics = [f"stats/{name}/{key}" for name in (*FLOATS, *SCALARS) for key in STATISTICS]
    assert set(table.column_names) == {*places, *statistics, *throws}
    ends = np.cumsum([len(episode["index"]) for episode in frames]).tolist()
    assert table["tasks"].to_pylist() == [["Throw the ball."]] * 4
    assert table["length"].to_pylist() == [len(episode["index"]) for episode in frames]
    assert table["dataset_from_index"].to_pylist() == [0, *ends[:-1]]
    assert table["dataset_to_index"].to_pylist() == ends
    for name in ("data/chunk_index", "data/file_index", "meta/episodes/chunk_index", "meta/episodes/file_index"):
        assert table[name].to_pylist() == [0] * 4
    for name, values in throws.items():
        assert table[name].to_pylist() == [values[trial] for trial in WITH_EPISODE], name


def test_statistics_of_episodes_are_exact(exported: Export, source: Path) -> None:
    rows = pq.read_table(exported("lerobot") / "meta" / "episodes" / "chunk-000" / "file-000.parquet").to_pylist()
    for row, episode in zip(rows, frames_of(source), strict=True):
        for name, stored in episode.items():
            values = stored.reshape(len(stored), -1).astype(float)
            expected = statistics_of(values)
            for key in STATISTICS:
                np.testing.assert_allclose(
                    row[f"stats/{name}/{key}"], expected[key], rtol=1e-12, atol=1e-12, err_msg=name
                )


def test_statistics_of_all_frames_are_exact_but_for_quantiles_which_are_means_of_those_of_episodes(
    exported: Export, source: Path
) -> None:
    statistics = json.loads((exported("lerobot") / "meta" / "stats.json").read_text())
    episodes = frames_of(source)
    assert set(statistics) == set(episodes[0])
    for name, stored in join(episodes).items():
        expected = statistics_of(stored.reshape(len(stored), -1).astype(float))
        parts = [statistics_of(each[name].reshape(len(each[name]), -1).astype(float)) for each in episodes]
        counts = [part["count"][0] for part in parts]
        for key in STATISTICS:
            value = np.average([part[key] for part in parts], 0, counts) if key[0] == "q" else expected[key]
            np.testing.assert_allclose(statistics[name][key], value, rtol=1e-12, atol=1e-12, err_msg=name)


def statistics_of(values: np.ndarray) -> dict[str, Any]:
    quantiles = {f"q{percent:02d}": np.quantile(values, percent / 100, axis=0) for percent in (1, 10, 50, 90, 99)}
    return {
        "min": values.min(axis=0),
        "max": values.max(axis=0),
        "mean": values.mean(axis=0),
        "std": values.std(axis=0),
        "count": [len(values)],
        **quantiles,
    }


def test_the_task_text_is_the_index_of_the_task_table(exported: Export) -> None:
    path = exported("lerobot") / "meta" / "tasks.parquet"
    assert pq.read_table(path).to_pydict() == {"task_index": [0], "task": ["Throw the ball."]}
    frame = pytest.importorskip("pandas").read_parquet(path)
    assert (frame.index.name, frame.iloc[0].name, list(frame.columns)) == ("task", "Throw the ball.", ["task_index"])


def test_the_exported_table_also_has_trials_without_an_episode(exported: Export, source: Path) -> None:
    table = pq.read_table(exported("lerobot") / "throws.parquet")
    found = table.to_pydict()
    assert found.pop("episode_index") == [0, None, 1, 2, 3, None]
    assert found == table_of(source)
    assert table.schema.metadata[b"throwcollect.digest"] == info(source).digest.encode()
    assert table.schema.field("landing_x_m").metadata[b"unit"] == b"m"


@pytest.mark.parametrize(("limit", "least"), [("MEGABYTES_PER_FILE", 0), ("_TABLES_PER_FILE", 1)])
def test_data_files_and_directories_are_split_at_their_limits(
    limit: str, least: int, source: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, exported: Export
) -> None:
    monkeypatch.setattr(parquet, limit, least)
    monkeypatch.setattr(parquet, "FILES_PER_CHUNK", 3)
    export(source, tmp_path / "out", to="lerobot")
    names = sorted(str(path.relative_to(tmp_path / "out")) for path in (tmp_path / "out" / "data").rglob("*.parquet"))
    assert names == [
        "data/chunk-000/file-000.parquet",
        "data/chunk-000/file-001.parquet",
        "data/chunk-000/file-002.parquet",
        "data/chunk-001/file-000.parquet",
    ]
    whole = pq.read_table(exported("lerobot") / "data" / "chunk-000" / "file-000.parquet")
    assert pa.concat_tables(pq.read_table(tmp_path / "out" / name) for name in names).equals(whole)
    episodes = pq.read_table(tmp_path / "out" / "meta" / "episodes" / "chunk-000" / "file-000.parquet")
    assert episodes["data/chunk_index"].to_pylist() == [0, 0, 0, 1]
    assert episodes["data/file_index"].to_pylist() == [0, 1, 2, 0]
    statistics = [
        json.loads((place / "meta" / "stats.json").read_text()) for place in (tmp_path / "out", exported("lerobot"))
    ]
    assert statistics[0] == statistics[1]


@pytest.mark.parametrize(("rate_hz", "step"), [(250, 1), (50, 5)])
def test_the_lerobot_library_reads_the_export(
    rate_hz: int, step: int, exported: Export, source: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("HF_HUB_OFFLINE", "1")
    library = pytest.importorskip("lerobot.datasets.lerobot_dataset")
    torch = pytest.importorskip("torch")
    root = exported("lerobot", None if rate_hz == 250 else rate_hz)
    frames = join(frames_of(source, step, rate_hz))
    dataset = library.LeRobotDataset("me/throws", root=root)
    assert (len(dataset), dataset.num_episodes, dataset.fps) == (len(frames["index"]), 4, rate_hz)
    for index in (0, 1, 57, len(dataset) - 1):
        item = dataset[index]
        assert item["task"] == "Throw the ball."
        for name, values in frames.items():
            assert np.array_equal(item[name].numpy(), values[index]), name
    for name, values in frames.items():
        numbers = values.reshape(len(dataset), -1).astype(float)
        np.testing.assert_allclose(dataset.meta.stats[name]["mean"], numbers.mean(axis=0), rtol=1e-9, atol=1e-12)
        np.testing.assert_allclose(dataset.meta.stats[name]["std"], numbers.std(axis=0), rtol=1e-9, atol=1e-12)
    ahead = {"action": [step / rate_hz for step in range(8)]}
    windows = library.LeRobotDataset("me/throws", root=root, delta_timestamps=ahead)
    batch = next(iter(torch.utils.data.DataLoader(windows, batch_size=4)))
    assert np.array_equal(batch["action"][2].numpy(), frames["action"][2:10])
    landed = library.LeRobotDataset("me/throws", root=root, episode_filter=lambda each: each["outcome"] == "landed")
    assert landed.num_episodes == 3


@pytest.mark.parametrize(("way", "most"), [("av1", 4.0), ("h264", 4.0), ("png", 0.01), ("depth", 0.01)])
def test_the_lerobot_library_reads_each_image_at_its_time(
    way: str, most: float, seen: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("HF_HUB_OFFLINE", "1")
    library = pytest.importorskip("lerobot.datasets.lerobot_dataset")
    export(seen, tmp_path / "out", to="lerobot", images=way)
    dataset = library.LeRobotDataset("me/throws", root=tmp_path / "out")
    depths = {"observation.images.side_depth", "observation.images.front_depth"} if way == "depth" else set()
    assert set(dataset.meta.camera_keys) == {"observation.images.head", "observation.images.side"} | depths
    assert set(dataset.meta.depth_keys) == depths
    first = 0
    for throw in throwcollect.load(seen):
        for name, step in (("head", 2), ("side", 5)):
            pictures = throw.sensors[name].images[::step]
            for number, picture in enumerate(pictures):
                item = dataset[first + number]
                assert item["timestamp"].item() == np.float32(number / 5)
                image = item[f"observation.images.{name}"].numpy().transpose(1, 2, 0) * 255
                assert image.shape == picture.shape
                assert np.abs(image - picture).mean() < most
                if depths and name == "side":
                    depth_m = throw.sensors[name].depth_m[number * step]
                    read_mm = item["observation.images.side_depth"].numpy()
                    assert np.abs(read_mm - np.where(np.isinf(depth_m), 0, depth_m * 1000)).max() < 0.51
        first += len(pictures)
    assert len(dataset) == first
    assert dataset.meta.stats["observation.images.side"]["mean"].shape == (3, 1, 1)
