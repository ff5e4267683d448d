"""Exports of throws with targets."""

from __future__ import annotations

import json
from pathlib import Path

import h5py
import numpy as np
import pyarrow.parquet as pq
import pytest
from scipy.io import loadmat
from tests.unit.dataset.targeted import LIST, collect_targeted

from throwcollect.publish.export.export import export

WANTED = [[1.4, -0.1], [1.5, 0.2], [1.6, 0.1]]
TEXTS = [
    "Throw the ball to x 1.40 m, y -0.10 m.",
    "Throw the ball to x 1.50 m, y 0.20 m.",
    "Throw the ball to x 1.60 m, y 0.10 m.",
]


@pytest.fixture(scope="module")
def targeted(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Three throws, each with a target."""
    return collect_targeted(tmp_path_factory.mktemp("all") / "data", LIST.replace("1.0,,\n", ""))


@pytest.fixture(scope="module")
def partly(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Four throws, of which the second one has no target."""
    return collect_targeted(tmp_path_factory.mktemp("some") / "data")


def test_a_card_says_whether_all_throws_have_targets(targeted: Path, partly: Path, tmp_path: Path) -> None:
    export(targeted, tmp_path / "all", to="npz")
    export(partly, tmp_path / "some", to="npz")
    cards = [(tmp_path / name / "README.md").read_text() for name in ("all", "some")]
    assert "Every throw has a target, `target_x_m`, `target_y_m`, which is the same in all its samples" in cards[0]
    assert "Not every throw has a target" in cards[1]
    for card in cards:
        assert "| `miss_m` | m | Distance of where the trial ended from its target, in x, y [m]. |" in card


def test_exported_tables_have_targets_and_misses(partly: Path, tmp_path: Path) -> None:
    export(partly, tmp_path / "parquet", to="parquet")
    export(partly, tmp_path / "npz", to="npz")
    table = pq.read_table(tmp_path / "parquet" / "throws.parquet")
    assert table["target_x_m"].to_pylist() == [1.4, None, 1.5, 1.6]
    assert table["miss_m"].null_count == 1
    arrays = np.load(tmp_path / "npz" / "throws.npz")
    assert np.array_equal(arrays["target_y_m"], [-0.1, np.nan, 0.2, 0.1], equal_nan=True)
    with np.load(next((tmp_path / "npz" / "trajectories").glob("*.npz"))) as archive:
        assert "target_x_m" not in archive


def test_every_exported_sample_has_the_target_of_its_throw(targeted: Path, tmp_path: Path) -> None:
    export(targeted, tmp_path / "parquet", to="parquet")
    samples = pq.read_table(tmp_path / "parquet" / "trajectories").to_pandas()
    assert samples.groupby("trial")[["target_x_m", "target_y_m"]].agg(["min", "max"]).to_numpy().tolist() == [
        [x, x, y, y] for x, y in WANTED
    ]
    export(targeted, tmp_path / "hdf5", to="hdf5")
    with h5py.File(tmp_path / "hdf5" / "throws.hdf5") as file:
        for trial, (x, _) in enumerate(WANTED):
            target = file[f"data/demo_{trial}/obs/target_x_m"]
            assert target.shape == (file[f"data/demo_{trial}"].attrs["num_samples"], 1)
            assert np.unique(target) == [x]
            assert target.attrs["unit"] == "m"
    export(targeted, tmp_path / "mat", to="mat")
    (path,) = (tmp_path / "mat" / "trajectories").glob("*.mat")
    throws = loadmat(path, simplify_cells=True)["robot_throws"]
    assert throws["wanted"].tolist() == WANTED
    assert throws["wanted_names"].tolist() == ["target_x_m", "target_y_m"]


def test_lerobot_has_the_target_in_the_environment_state_and_in_the_task_text(targeted: Path, tmp_path: Path) -> None:
    export(targeted, tmp_path / "lerobot", to="lerobot")
    described = json.loads((tmp_path / "lerobot" / "meta" / "info.json").read_text())
    assert described["features"]["observation.environment_state"]["names"][6:] == ["target.x", "target.y"]
    assert described["total_tasks"] == 3
    tasks = pq.read_table(tmp_path / "lerobot" / "meta" / "tasks.parquet").to_pandas()
    assert tasks["task_index"].to_dict() == {text: number for number, text in enumerate(TEXTS)}
    episodes = pq.read_table(tmp_path / "lerobot" / "meta" / "episodes")
    assert episodes["tasks"].to_pylist() == [[text] for text in TEXTS]
    frames = pq.read_table(tmp_path / "lerobot" / "data").to_pandas()
    for number, rows in frames.groupby("episode_index"):
        goals = np.unique(np.stack(rows["observation.environment_state"])[:, 6:], axis=0)
        assert goals.tolist() == [np.float32(WANTED[number]).tolist()]
        assert set(rows["task_index"]) == {number}


def test_throws_at_the_same_target_are_one_lerobot_task(tmp_path: Path) -> None:
    text = "task.duration_s,target_x_m,target_y_m,target_hit_angle_rad\n1,1.4,0,1.25\n1.1,1.4,0,1.25\n"
    source = collect_targeted(tmp_path / "data", text)
    export(source, tmp_path / "lerobot", to="lerobot")
    tasks = pq.read_table(tmp_path / "lerobot" / "meta" / "tasks.parquet").to_pandas()
    assert list(tasks.index) == ["Throw the ball to x 1.40 m, y 0.00 m, hit angle 1.25 rad."]
    described = json.loads((tmp_path / "lerobot" / "meta" / "info.json").read_text())
    names = described["features"]["observation.environment_state"]["names"]
    assert names[6:] == ["target.x", "target.y", "target.hit_angle"]


def test_lerobot_has_a_task_without_target_if_any_throw_has_none(partly: Path, tmp_path: Path) -> None:
    export(partly, tmp_path / "lerobot", to="lerobot")
    tasks = pq.read_table(tmp_path / "lerobot" / "meta" / "tasks.parquet").to_pandas()
    assert list(tasks.index) == ["Throw the ball."]
    frames = pq.read_table(tmp_path / "lerobot" / "data")
    assert frames.schema.field("observation.environment_state").type.list_size == 6
