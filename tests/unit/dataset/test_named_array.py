"""Columns, parameters and landings of a dataset as NumPy arrays and pandas tables."""

from __future__ import annotations

import pickle
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

import throwcollect
from throwcollect.dataset.reader import Dataset
from throwcollect.errors import ConfigError


@pytest.fixture(scope="module")
def loaded(collected: Path) -> Dataset:
    return throwcollect.load(collected)


@pytest.fixture
def with_gaps(collection: Any, tmp_path: Path) -> Dataset:
    """Trial 2 was refused, trial 4 lost."""
    collection.refuse(2, "an elbow needs 30 Nm")
    return throwcollect.load(collection.collect(tmp_path / "dataset", [0, 1, 3, 4, 5, 6], lost=[4]))


def test_parameters_are_bounded_by_the_sweep(loaded: Dataset) -> None:
    parameters = loaded.parameters
    assert parameters.names == ("task.duration_s",)
    assert parameters.bounds.tolist() == [[0.8, 1.2]]
    assert np.asarray(parameters).shape == parameters.values.shape == (7, 1)
    assert parameters["task.duration_s"].tolist() == loaded.throws["task_duration_s"].to_pylist()
    assert np.array_equal(loaded[2:4].parameters.values, parameters.values[2:4])
    assert np.array_equal(loaded[2:4].parameters.bounds, parameters.bounds)


def test_parameters_of_a_list_are_bounded_by_their_values(collection: Any, tmp_path: Path) -> None:
    points = tmp_path / "points.csv"
    points.write_text("task.duration_s,ball.mass_kg\n1.0,0.03\n0.9,0.05\n1.1,0.04\n")
    config = {"trials": 3, "sweep": {"sampler": "list", "file": str(points)}}
    listed = type(collection)(config).collect(tmp_path / "dataset")
    assert throwcollect.load(listed).parameters.bounds.tolist() == [[0.9, 1.1], [0.03, 0.05]]


def test_landings_are_nan_where_nothing_landed(with_gaps: Dataset) -> None:
    landings = with_gaps.landings
    assert landings.names == ("landing_x_m", "landing_y_m", "landing_z_m")
    assert np.flatnonzero(np.isnan(landings.values).any(axis=1)).tolist() == [2, 4]
    assert landings.values[0].tolist() == with_gaps[0].events.landing.position.tolist()
    assert np.array_equal(landings.bounds, np.column_stack([np.nanmin(landings, axis=0), np.nanmax(landings, axis=0)]))


def test_a_column_of_a_dataset_is_an_array_with_nan_for_missing_numbers(with_gaps: Dataset) -> None:
    assert with_gaps["outcome"].tolist() == with_gaps.throws["outcome"].to_pylist()
    assert with_gaps["reason"][0] is None
    assert np.isnan(with_gaps["samples"]).tolist() == [False, False, True, False, True, False, False]
    assert with_gaps["trial"].dtype == np.int64
    with_gaps["landing_x_m"][:] = 0.0
    assert (with_gaps["landing_x_m"] != 0).all(), "the caller's own"
    assert with_gaps[0]["landing_x_m"] == with_gaps["landing_x_m"][0]


def test_a_dataset_as_a_pandas_table_has_the_trials_as_its_index(with_gaps: Dataset) -> None:
    frame = with_gaps.to_pandas()
    assert frame.index.name == "trial"
    assert frame.index.tolist() == list(range(7))
    assert frame.columns.tolist() == with_gaps.throws.column_names[1:]
    assert frame.loc[2, "outcome"] == "refused"
    assert np.isnan(frame.loc[4, "landing_x_m"])


def test_a_throw_as_a_pandas_table_has_times_joints_and_ball(loaded: Dataset) -> None:
    throw = loaded[3]
    frame = throw.to_pandas()
    assert frame.index.name == "time_s"
    assert np.array_equal(frame.index, throw.ball.time_s)
    assert np.array_equal(frame[["ball_x_m", "ball_y_m", "ball_z_m"]], throw.ball.position)
    assert np.array_equal(frame[["ball_wx_radps", "ball_wy_radps", "ball_wz_radps"]], throw.ball.angular_velocity)
    elbow = throw.joints["arm_right_4_joint"]
    assert np.array_equal(frame["arm_right_4_joint_position_rad"], elbow.position)
    assert np.array_equal(frame["arm_right_4_joint_effort_nm"], elbow.effort)
    assert frame.shape == (len(throw.ball), 3 * len(throw.joints.names) + 13)


def test_a_joint_is_found_by_its_name(loaded: Dataset) -> None:
    joints = loaded[0].joints
    which = joints.names.index("torso_1_joint")
    assert np.array_equal(joints["torso_1_joint"].velocity, joints.velocity[:, which])
    assert [joint.name for joint in joints] == list(joints.names)
    assert "torso_1_joint" in joints
    assert "arm_right_4" not in joints
    with pytest.raises(KeyError, match=r"no joint 'arm_right_4'; there are .*arm_right_4_joint"):
        joints["arm_right_4"]


def test_an_unknown_column_is_an_error_that_names_all(loaded: Dataset) -> None:
    for look in (loaded.__getitem__, loaded[0].__getitem__, loaded.landings.__getitem__):
        with pytest.raises(KeyError, match=r"no column 'landing_x'; there are .*landing_x_m"):
            look("landing_x")


def test_what_is_no_position_is_an_error_and_a_pickled_dataset_still_has_its_throws(loaded: Dataset) -> None:
    with pytest.raises(TypeError, match=r"the name of a column, not ndarray; see select\(\.\.\.\)"):
        loaded[np.arange(3)]
    with pytest.raises(TypeError):
        iter(loaded.parameters)
    assert pickle.loads(pickle.dumps(loaded))[0].trial == 0  # noqa: S301


def test_landings_are_an_error_for_a_task_in_which_nothing_lands(loaded: Dataset) -> None:
    without = Dataset(loaded.directory, loaded.plan, loaded.throws.drop_columns(["landing_z_m"]), {})
    with pytest.raises(ConfigError, match=r"^nothing lands in the task throw"):
        _ = without.landings


def test_a_number_of_numpy_is_a_position_in_a_dataset(loaded: Dataset) -> None:
    assert loaded[np.int64(-1)].trial == 6
    assert isinstance(loaded.to_pandas().mean(numeric_only=True), pd.Series)
