from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import throwcollect
from throwcollect.dataset.reader import Dataset
from throwcollect.dataset.trajectories import list_columns
from throwcollect.errors import DatasetError
from throwcollect.robots.talos import TALOS

COLUMNS = tuple(list_columns(["ball"]))


@pytest.fixture(scope="module")
def loaded(collected: Path) -> Dataset:
    return throwcollect.load(collected)


def column_of(throw: Any, name: str) -> np.ndarray:
    if name in ("time_s", "stamps_ns"):
        return getattr(throw.ball, name)
    owner, _, attribute = name.partition("_")
    return getattr(getattr(throw, owner), attribute)


@pytest.mark.parametrize("threads", [None, 1, 3])
def test_trajectories_hold_the_samples_of_the_throws_one_after_the_other(loaded: Dataset, threads: int | None) -> None:
    many = loaded.select(list(range(7)) * 6)  # more than are read at once
    found = many.trajectories(threads=threads)
    assert tuple(found.columns) == COLUMNS
    assert len(found) == len(many)
    assert found.trials.tolist() == list(range(7)) * 6
    for position, (throw, one) in enumerate(zip(many, found, strict=True)):
        assert found.lengths[position] == throw.row["samples"]
        for name in COLUMNS:
            expected = column_of(throw, name)
            assert np.array_equal(one[name], expected), name
            assert one[name].base is not None, "a view"
            rows = slice(found.offsets[position], found.offsets[position + 1])
            assert np.array_equal(found[name][rows], expected)
            assert found[name].dtype == expected.dtype
            assert found[name].flags.c_contiguous
            assert found[name].flags.writeable


def test_trajectories_of_chosen_joints_hold_only_their_columns(loaded: Dataset) -> None:
    every = loaded.trajectories()
    for joints in (loaded.moving_joints, ("leg_left_1_joint",), ()):
        some = loaded.trajectories(["joints_position", "joints_effort", "ball_position"], joints=joints)
        assert some.joints == joints
        indexes = [TALOS.joints.index(joint) for joint in joints]
        for name in ("joints_position", "joints_effort"):
            assert np.array_equal(some[name], every[name][:, indexes])
        assert np.array_equal(some["ball_position"], every["ball_position"])
    assert set(loaded.moving_joints) == {"torso_1_joint", *(f"arm_right_{n}_joint" for n in (1, 2, 4, 7))}


def test_trajectories_of_trials_without_an_episode_have_no_samples(collection: Any, tmp_path: Path) -> None:
    collection.refuse(0, "too fast")
    dataset = throwcollect.load(collection.collect(tmp_path / "dataset", range(1, 7), lost=[6]))
    found = dataset.trajectories(["ball_position", "stamps_ns"])
    assert (found.lengths > 0).tolist() == [False, *[True] * 5, False]
    assert np.array_equal(found[3]["ball_position"], dataset[3].ball.position)
    assert found[0]["ball_position"].shape == (0, 3)
    nothing = dataset.select([6, 0]).trajectories()
    assert nothing["joints_position"].shape == (0, 32)
    assert nothing.padded("ball_position").shape == (2, 0, 3)
    assert len(dataset.select([]).trajectories()) == 0


def test_padded_trajectories_have_one_shape(loaded: Dataset) -> None:
    found = loaded.trajectories(["time_s", "ball_position"])
    assert len(set(found.lengths)) > 1
    for name, rest in (("time_s", ()), ("ball_position", (3,))):
        padded = found.padded(name)
        assert padded.shape == (7, found.lengths.max(), *rest)
        for one, row, length in zip(found, padded, found.lengths, strict=True):
            assert np.array_equal(row[:length], one[name])
            assert np.isnan(row[length:]).all()
    assert found.padded("time_s", fill=-1).min() == -1


def test_trajectories_refuse_a_recording_with_a_flipped_bit(dataset: Path) -> None:
    loaded = throwcollect.load(dataset)
    path, start = dataset / "quick_00002.mcap", loaded[6].row["chunk_offset"]
    whole = path.read_bytes()
    for place in range(start + 60, start + 5000, 397):
        contents = bytearray(whole)
        contents[place] ^= 1
        path.write_bytes(contents)
        with pytest.raises(DatasetError, match=rf"quick_00002\.mcap: byte {start}: chunk: "):
            loaded.trajectories(["time_s"])


@pytest.mark.parametrize("topics", [["clock"], ["clock", "tf", "controller_state"]])
def test_further_recorded_topics_do_not_change_trajectories(
    make_collection: Any, loaded: Dataset, tmp_path: Path, topics: list[str]
) -> None:
    record = {"trials_per_shard": 3, "topics": ["joint_states", "ball/odometry", *topics]}
    more = throwcollect.load(make_collection({"record": record}).collect(tmp_path / "dataset"))
    found, expected = more.trajectories(), loaded.trajectories()
    for name in COLUMNS:
        assert np.array_equal(found[name], expected[name])
