from __future__ import annotations

import multiprocessing
import pickle
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.parquet as pq
import pytest
from tests.unit.dataset.damage import change_table, replace_text

import throwcollect
from throwcollect.dataset.reader import Dataset
from throwcollect.errors import ConfigError, DatasetError


@pytest.fixture(scope="module")
def loaded(collected: Path) -> Dataset:
    return throwcollect.load(str(collected))


@pytest.fixture
def with_gaps(collection: Any, tmp_path: Path) -> Dataset:
    """Trial 2 was refused, trial 4 lost."""
    collection.refuse(2, "an elbow needs 30 Nm")
    return throwcollect.load(collection.collect(tmp_path / "dataset", [0, 1, 3, 4, 5, 6], lost=[4]))


def trials(dataset: Dataset) -> list[int]:
    return [throw.trial for throw in dataset]


def last_position(throw_dataset: Dataset, index: int) -> list[float]:
    return [float(each) for each in throw_dataset[index].ball.position[-1]]


def test_a_loaded_dataset_has_its_table_and_its_throws_by_position(loaded: Dataset, collected: Path) -> None:
    assert loaded.throws.equals(pq.read_table(collected / "throws.parquet"))
    assert len(loaded) == len(loaded.throws) == 7
    assert trials(loaded) == list(range(7))
    assert (loaded[-1].trial, loaded[3].trial) == (6, 3)
    assert loaded.plan.keys == ("task.duration_s",)
    assert loaded[3].parameters == {"task.duration_s": loaded.throws["task_duration_s"][3].as_py()}
    assert loaded.config.name == "quick"


def test_the_episode_of_a_trial_is_found_in_a_selection_in_any_order(loaded: Dataset) -> None:
    chosen = loaded.select([5, 1, 0])
    assert [chosen.episode(trial).digest for trial in (0, 1, 5)] == [loaded.episode(k).digest for k in (0, 1, 5)]
    with pytest.raises(DatasetError, match="no trial 2"):
        chosen.episode(2)


def test_a_trial_without_an_episode_has_a_row_and_says_why_it_has_no_samples(with_gaps: Dataset) -> None:
    assert len(with_gaps) == 7
    refused, lost = with_gaps[2], with_gaps[4]
    assert (refused.outcome, refused.reason, refused.recorded) == ("refused", "an elbow needs 30 Nm", False)
    assert refused.events.landing is None
    assert "refused: an elbow needs 30 Nm; not recorded" in repr(refused)
    for look in (lambda: refused.ball, lambda: refused.joints, lambda: refused.events.contacts):
        with pytest.raises(DatasetError, match="trial 2 has no episode: refused: an elbow needs 30 Nm") as caught:
            look()
        assert "dataset.recorded" in str(caught.value)
    with pytest.raises(DatasetError, match="trial 4 has no episode: lost: two simulations were lost"):
        _ = lost.ball
    with pytest.raises(DatasetError, match="trial 4 has no episode: lost: two simulations were lost"):
        with_gaps.episode(4)
    with pytest.raises(DatasetError, match="no trial 7"):
        with_gaps.episode(7)
    assert trials(with_gaps.recorded) == [0, 1, 3, 5, 6]
    assert with_gaps.recorded[2].ball.position[-1].tolist() == last_position(with_gaps, 3)


@pytest.mark.parametrize(
    ("which", "found"),
    [
        ("trial >= 4", [4, 5, 6]),
        ("trial > 7", []),
        (pc.field("trial") < 2, [0, 1]),
        ([True, False, False, True, False, False, False], [0, 3]),
        (np.arange(7) % 3 == 0, [0, 3, 6]),
        (pd.Series(range(7)) > 4, [5, 6]),
        (pa.array([True, None, False, False, False, False, True]), [0, 6]),
        (pa.chunked_array([[True] * 3, [False] * 4]), [0, 1, 2]),
        ([5, 2], [5, 2]),
        (np.array([1, 1]), [1, 1]),
        (range(2, 4), [2, 3]),
        ((number for number in (3, 1)), [3, 1]),
        (pa.array([6]), [6]),
        ([], []),
    ],
)
def test_select_takes_conditions_masks_and_numbers_of_trials(loaded: Dataset, which: Any, found: list[int]) -> None:
    some = loaded.select(which)
    assert trials(some) == found == some.throws["trial"].to_pylist()
    assert [last_position(some, number) for number in range(len(some))] == [last_position(loaded, n) for n in found]


def test_select_goes_by_trial_and_a_slice_by_position(loaded: Dataset) -> None:
    some = loaded.select([6, 1, 4])
    assert trials(some.select([4])) == [4]
    assert trials(some[1:]) == [1, 4]
    assert trials(loaded[::-3]) == [6, 3, 0]
    with pytest.raises(DatasetError, match="no trial 3 among the 3 throws"):
        some.select([4, 3])


@pytest.mark.parametrize("which", ["trial >", pc.field("height") > 1, [True, False], [1.5], ["landed"], [1, "a"], 3])
def test_a_selection_that_makes_no_sense_is_an_error(loaded: Dataset, which: Any) -> None:
    with pytest.raises((ConfigError, ValueError, TypeError)):
        loaded.select(which)


def test_a_dataset_can_be_read_by_other_processes(loaded: Dataset) -> None:
    expected = [last_position(loaded, number) for number in range(7)]
    with multiprocessing.get_context("fork").Pool(3) as pool:
        assert pool.starmap(last_position, [(loaded, number) for number in range(7)]) == expected


def test_a_dataset_can_be_read_by_many_threads(loaded: Dataset) -> None:
    expected = [last_position(loaded, number) for number in range(7)]
    with ThreadPoolExecutor(8) as pool:
        found = list(pool.map(lambda number: last_position(loaded, number % 7), range(70)))
    assert found == expected * 10


def test_a_pickled_throw_holds_no_samples_and_reads_them_again(loaded: Dataset) -> None:
    throw = loaded[5]
    position = throw.ball.position
    packed = pickle.dumps(throw)
    assert len(packed) < throw.joints.position.nbytes
    copy = pickle.loads(packed)  # noqa: S301
    assert copy.row == throw.row
    assert np.array_equal(copy.ball.position, position)
    assert repr(copy) == repr(throw)


def test_no_recording_stays_open_after_reading(loaded: Dataset) -> None:
    throw = loaded[1]
    assert throw.ball.position.shape
    assert loaded.trajectories(threads=2)
    assert ".mcap" not in Path("/proc/self/maps").read_text()
    assert not [link for link in Path("/proc/self/fd").iterdir() if link.resolve().suffix == ".mcap"]


def test_a_dataset_of_another_format_is_refused(dataset: Path) -> None:
    replace_text(dataset / "metadata.yaml", "throwcollect.format: '2'", "throwcollect.format: '1'")
    with pytest.raises(DatasetError, match="has the format 1\n  expected: 2"):
        Dataset.open(dataset)


def test_an_episode_is_read_back_as_it_was_written(collection: Any, dataset: Path) -> None:
    loaded = Dataset.open(dataset)
    for trial in (5, 0, 6):
        sent, stored = collection.episode(trial), loaded.episode(trial)
        assert (stored.header, stored.chunk, stored.digest) == (sent.header, sent.chunk, sent.digest)
        assert np.array_equal(stored.samples().position, sent.samples().position)


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("throws.parquet", r"throws\.parquet: is missing"),
        ("plan.parquet", r"plan\.parquet: is missing"),
        ("metadata.yaml", r"the dataset is not finished: it has no metadata\.yaml"),
    ],
)
def test_opening_a_dataset_names_the_missing_file_and_the_remedy(dataset: Path, name: str, message: str) -> None:
    (dataset / name).unlink()
    with pytest.raises(DatasetError, match=message) as caught:
        Dataset.open(dataset)
    assert caught.value.hint == f"throwcollect resume {dataset}"


@pytest.mark.parametrize("shard", ["../quick_00001.mcap", "quick\0.mcap"])
def test_a_table_of_throws_cannot_name_other_files(dataset: Path, shard: str) -> None:
    change_table(dataset / "throws.parquet", "shard", 4, shard)
    with pytest.raises(DatasetError, match=r"throws\.parquet: shard is '.*' in some row") as caught:
        Dataset.open(dataset)
    assert caught.value.hint == f"throwcollect resume {dataset}"
