"""A dataset that is still being collected, or was interrupted, can be read with its episodes so far."""

from __future__ import annotations

from contextlib import closing
from pathlib import Path
from typing import Any

import pytest

import throwcollect
from throwcollect.dataset import reader, recovery
from throwcollect.dataset.creation import create
from throwcollect.dataset.writer import DatasetWriter
from throwcollect.errors import DatasetError


def begin(collection: Any, directory: Path, trials: list[int]) -> Path:
    create(directory, collection.plan)
    writer = DatasetWriter.open(directory)
    collection.fill(writer, trials)
    writer.close()
    return directory


def test_an_unfinished_dataset_has_rows_of_the_trials_that_have_ended(
    collection: Any, collected: Path, tmp_path: Path
) -> None:
    collection.refuse(5, "an elbow needs 30 Nm")
    # The first shard is finished, the second has one of its three episodes, the third has none.
    directory = begin(collection, tmp_path / "dataset", [2, 0, 1, 4])
    with pytest.warns(
        throwcollect.UnfinishedDatasetWarning, match=r"is not finished: it has 5 of 7 trials so far"
    ) as said:
        dataset = throwcollect.load(directory)
    assert said[0].filename == __file__
    assert [throw.trial for throw in dataset] == [0, 1, 2, 4, 5]
    assert dataset["outcome"].tolist() == ["landed"] * 4 + ["refused"]
    whole = throwcollect.load(collected)
    for throw in dataset.recorded:
        assert throw.ball.position.tolist() == whole[throw.trial].ball.position.tolist()
    assert (
        dataset.throws.drop_columns(["shard", "chunk_offset"])
        .slice(0, 4)
        .equals(whole.throws.drop_columns(["shard", "chunk_offset"]).take([0, 1, 2, 4]))
    )
    with pytest.raises(DatasetError, match=r"throwcollect\.digest is missing"):
        _ = dataset.digest


def test_an_incomplete_last_episode_of_an_unfinished_dataset_is_left_out(collection: Any, tmp_path: Path) -> None:
    directory = begin(collection, tmp_path / "dataset", [0, 1])
    part = directory / "quick_00000.mcap.part"
    part.write_bytes(part.read_bytes()[:-100])
    with pytest.warns(throwcollect.UnfinishedDatasetWarning, match="it has 1 of 7 trials"):
        assert [throw.trial for throw in throwcollect.load(directory)] == [0]


def test_a_shard_that_finishes_while_the_dataset_is_loaded_is_included(
    collection: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    create(tmp_path / "dataset", collection.plan)
    with closing(DatasetWriter.open(tmp_path / "dataset")) as writer:
        collection.fill(writer, [0, 1])
        waiting = [2]

        def find_episodes(path: Path, *arguments: Any) -> Any:
            if waiting:
                collection.fill(writer, [waiting.pop()])
            return recovery.find_episodes(path, *arguments)

        monkeypatch.setattr(reader, "find_episodes", find_episodes)
        with pytest.warns(throwcollect.UnfinishedDatasetWarning, match="it has 3 of 7 trials"):
            dataset = throwcollect.load(tmp_path / "dataset")
        assert all(len(throw.ball) for throw in dataset)
