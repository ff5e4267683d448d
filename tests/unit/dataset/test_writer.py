from __future__ import annotations

import os
import resource
from collections.abc import Iterator
from contextlib import closing, contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

import pyarrow.parquet as pq
import pytest
from tests.unit.dataset.conftest import create_and_open

from throwcollect.dataset.creation import create
from throwcollect.dataset.verify import verify
from throwcollect.dataset.writer import DatasetWriter
from throwcollect.episode.episode_message import Episode
from throwcollect.errors import ConfigError, DatasetError

MAY_DIFFER = {"README.md", "datapackage.json", "provenance.json"}


def files_of(directory: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in directory.iterdir() if path.is_file()}


def recordings_of(directory: Path) -> dict[str, bytes]:
    """All files but those that say how the dataset was collected."""
    return {name: data for name, data in files_of(directory).items() if name not in MAY_DIFFER}


@contextmanager
def file_size_limit(size: int) -> Iterator[None]:
    """No file may grow beyond a size: like a full disk, but without being root."""
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, hard))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))


@pytest.mark.parametrize("order", [(6, 5, 4, 3, 2, 1, 0), (3, 0, 6, 1, 4, 2, 5), (2, 5, 1, 4, 0, 3, 6)])
def test_files_do_not_depend_on_the_order_in_which_episodes_arrive(
    collection: Any, tmp_path: Path, order: tuple[int, ...]
) -> None:
    expected = files_of(collection.collect(tmp_path / "in_order", lost=[4]))
    shuffled = files_of(collection.collect(tmp_path / "shuffled", order, lost=[4]))
    assert expected.keys() == shuffled.keys()
    assert {name for name in expected if expected[name] != shuffled[name]} <= MAY_DIFFER


def test_keys_under_run_do_not_change_the_files(make_collection: Any, tmp_path: Path) -> None:
    one = files_of(make_collection({"run": {"simulations": 1}}).collect(tmp_path / "one"))
    other = files_of(make_collection({"run": {"simulations": 9, "retries": 0}}).collect(tmp_path / "other"))
    assert {name for name in one if one[name] != other[name]} <= MAY_DIFFER


def test_a_shard_without_any_episode_leaves_no_file(collection: Any, tmp_path: Path) -> None:
    directory = tmp_path / "dataset"
    writer = create_and_open(directory, collection.plan)
    with file_size_limit(0), pytest.raises(DatasetError, match="cannot be written"):
        collection.fill(writer, [0])
    assert (directory / "quick_00000.mcap.part").exists()
    for trial in range(3):
        writer.append_lost(trial, "full disk")
    assert not list(directory.glob("*_00000.mcap*"))
    writer.close()


def test_an_open_shard_holds_each_episode_as_soon_as_it_is_appended(collection: Any, tmp_path: Path) -> None:
    """`kill -9` leaves whole records: every chunk is followed by the metadata that name its trial."""
    from mcap.records import Chunk, Metadata
    from mcap.stream_reader import StreamReader

    writer = create_and_open(tmp_path / "dataset", collection.plan)
    for arrived, trial in enumerate([2, 0], start=1):
        collection.fill(writer, [trial])
        with (tmp_path / "dataset" / "quick_00000.mcap.part").open("rb") as file:
            records = []
            size = os.fstat(file.fileno()).st_size
            for record in StreamReader(file, emit_chunks=True).records:
                records.append(record)
                if file.tell() == size:
                    break
        assert sum(isinstance(record, Chunk) for record in records) == 1 + arrived
        last = records[-1]
        assert isinstance(last, Metadata)
        assert (last.name, last.metadata["trial"]) == ("throwcollect.episode", str(trial))
    writer.close()


def test_a_lost_trial_has_a_row_but_no_episode(collection: Any, tmp_path: Path) -> None:
    directory = collection.collect(tmp_path / "dataset", lost=[1])
    row = pq.read_table(directory / "throws.parquet").to_pylist()[1]
    assert (row["outcome"], row["reason"]) == ("lost", "two simulations were lost")
    assert [row[name] for name in ("shard", "chunk_offset", "samples", "digest", "landing_x_m")] == [None] * 5
    assert verify(directory) == []


def test_a_dataset_is_finished_without_its_refused_trials(collection: Any, tmp_path: Path) -> None:
    collection.refuse(0, "too fast")
    collection.refuse(6, "too far")
    directory = collection.collect(tmp_path / "dataset", range(1, 6))
    rows = pq.read_table(directory / "throws.parquet").to_pylist()
    assert [(row["trial"], row["reason"]) for row in rows if row["outcome"] == "refused"] == [
        (0, "too fast"),
        (6, "too far"),
    ]
    # Trial 6 is the only one of its shard, so that shard has no file.
    assert sorted(path.name for path in directory.glob("*.mcap")) == ["quick_00000.mcap", "quick_00001.mcap"]
    assert verify(directory) == []


def test_rows_hold_the_results_of_throws_and_columns_have_descriptions(collection: Any, dataset: Path) -> None:
    table = pq.read_table(dataset / "throws.parquet")
    result = collection.result(collection.episode(2))
    row = table.to_pylist()[2]
    assert row["task_duration_s"] == collection.plan.trials[2].values["task.duration_s"]
    for name in ("release", "apex", "landing"):
        ball = getattr(result, name)
        assert row[f"{name}_time_s"] == ball.time_s
        assert tuple(row[f"{name}_{axis}_m"] for axis in "xyz") == ball.position
        assert tuple(row[f"{name}_v{axis}_mps"] for axis in "xyz") == ball.velocity
    for name in ("position_peak", "velocity_peak", "effort_peak"):
        peak = getattr(result, name)
        assert (row[f"{name}_joint"], row[f"{name}_share"]) == (peak.joint, peak.share)
    same = "release_speed_mps release_elevation_rad flight_time_s hit_angle_rad recontacts effort_saturated_share"
    assert {name: row[name] for name in same.split()} == {name: getattr(result, name) for name in same.split()}
    errors = {f"{joint}_tracking_error_rad": error for joint, error in result.tracking_error_rad.items()}
    assert {name: row[name] for name in errors} == errors
    assert all(field.metadata[b"description"].endswith(b".") for field in table.schema)


def test_a_dataset_cannot_be_created_in_a_directory_with_files(collection: Any, tmp_path: Path) -> None:
    (tmp_path / "notes.txt").write_text("mine")
    with pytest.raises(ConfigError, match=r"holds notes\.txt"):
        create(tmp_path, collection.plan)
    assert files_of(tmp_path) == {"notes.txt": b"mine"}


def test_a_dataset_that_cannot_be_written_leaves_no_directory(collection: Any, tmp_path: Path) -> None:
    with (
        file_size_limit(2000),
        pytest.raises(DatasetError, match=r"plan\.parquet.*cannot be written|cannot be written"),
    ):
        create(tmp_path / "dataset", collection.plan)
    assert list(tmp_path.iterdir()) == []


def test_an_episode_that_does_not_fit_on_the_disk_leaves_the_shard_as_it_was(
    collection: Any, collected: Path, tmp_path: Path
) -> None:
    writer = create_and_open(tmp_path / "dataset", collection.plan)
    collection.fill(writer, [0])
    part = tmp_path / "dataset" / "quick_00000.mcap.part"
    before = part.read_bytes()
    with (
        file_size_limit(len(before) + 1000),
        pytest.raises(DatasetError, match=r"quick_00000\.mcap\.part: cannot be written"),
    ):
        collection.fill(writer, [1])
    assert part.read_bytes() == before
    # When there is space again, the failure has no effect.
    collection.fill(writer, range(1, 7))
    writer.finish()
    assert recordings_of(tmp_path / "dataset") == recordings_of(collected)


def test_a_shard_that_cannot_be_finished_on_a_full_disk_keeps_all_its_episodes_for_the_next_writer(
    collection: Any, collected: Path, tmp_path: Path
) -> None:
    directory = tmp_path / "dataset"
    writer = create_and_open(directory, collection.plan)
    collection.fill(writer, [0, 1])
    # The finished file is larger than the open one by its summary.
    with (
        file_size_limit((collected / "quick_00000.mcap").stat().st_size - 100),
        pytest.raises(DatasetError, match=r"quick_00000\.mcap: cannot be written"),
    ):
        collection.fill(writer, [2])
    assert sorted(path.name for path in directory.glob("*.mcap*")) == ["quick_00000.mcap.part"]
    writer.close()
    found: list[int] = []
    with closing(DatasetWriter.open(directory)) as successor:
        assert successor.recover(lambda trial, _: found.append(trial) is None) == 3
    assert found == [0, 1, 2]
    assert (directory / "quick_00000.mcap").read_bytes() == (collected / "quick_00000.mcap").read_bytes()


def test_the_writer_refuses_second_refused_and_unknown_episodes(collection: Any, tmp_path: Path) -> None:
    collection.refuse(3, "too fast")
    writer = create_and_open(tmp_path / "dataset", collection.plan)
    collection.fill(writer, [0])
    for trial in (0, 3):
        with pytest.raises(DatasetError, match=f"no episode of trial {trial} is waited for"):
            collection.fill(writer, [trial])
        with pytest.raises(DatasetError, match=f"no episode of trial {trial} is waited for"):
            writer.append_lost(trial, "gone")
    stranger = collection.episode(1)
    stranger = Episode(replace(stranger.header, trial=99), stranger.chunk)
    with pytest.raises(DatasetError, match="no episode of trial 99 is waited for"):
        writer.append(stranger, collection.columns.write(collection.result(collection.episode(1))))
    writer.close()


def test_a_dataset_with_missing_trials_is_not_finished(collection: Any, tmp_path: Path) -> None:
    writer = create_and_open(tmp_path / "dataset", collection.plan)
    collection.fill(writer, [0, 1, 3, 4, 5, 6])
    with pytest.raises(DatasetError, match="lacks 1 trial, such as 2"):
        writer.finish()
    assert not (tmp_path / "dataset" / "metadata.yaml").exists()
    writer.close()
