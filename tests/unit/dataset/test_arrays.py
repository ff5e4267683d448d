"""Columns, throws and joints of a dataset as NumPy arrays and pandas tables."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import throwcollect
from throwcollect.dataset.reader import Dataset


@pytest.fixture(scope="module")
def loaded(collected: Path) -> Dataset:
    return throwcollect.load(collected)


@pytest.fixture
def with_gaps(collection: Any, tmp_path: Path) -> Dataset:
    """Trial 2 was refused, trial 4 lost."""
    collection.refuse(2, "an elbow needs 30 Nm")
    return throwcollect.load(collection.collect(tmp_path / "dataset", [0, 1, 3, 4, 5, 6], lost=[4]))


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
