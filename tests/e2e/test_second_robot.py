"""The robot of another package, `tests/plugins`, from its configuration to derived and exported datasets."""

from __future__ import annotations

import shutil
import subprocess
from collections.abc import Callable, Iterator
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
from typing import Any

import pytest

from tests.e2e.collection import call_here, collect, fingerprints
from tests.e2e.plugins import process_with_plugins, run_program

pytestmark = pytest.mark.e2e
Say = Callable[..., subprocess.CompletedProcess[str]]
Run = Callable[[str], dict[str, Any]]

CONFIG = """\
name: arm
robot: {name: planar_arm}
task:
  start: {shoulder_joint: 0.0, elbow_joint: 0.0}
  end: {shoulder_joint: 1.4, elbow_joint: 0.3}
  duration_s: 0.5
record: {topics: [joint_states, ball/odometry, tf, controller_state]}
sweep: {sampler: uniform, parameters: {task.duration_s: {min: 0.35, max: 0.6}}}
trials: 6
run: {runtime: local, replay: 2}
"""
READ = """
import throwcollect

dataset = throwcollect.load(directory)
throw = dataset[4]
every, elbow = dataset.trajectories(["joints_position"]), dataset.trajectories(joints=["elbow_joint"])
with throwcollect.Simulator(directory / "config.yaml") as simulator:
    simulated = simulator.throw(throw.parameters, trial=4)
found = {
    "joints": [dataset.joints, throw.joints.names, simulated.joints.names, dataset.moving_joints],
    "digests": [throw.row["digest"], simulated.row["digest"]],
    "end": throw.joints.position[-1].tolist(),
    "ends": every[4]["joints_position"][-1].tolist() + elbow[4]["joints_position"][-1].tolist(),
    "statistics": {group: [*signals] for group, signals in throwcollect.compute_statistics(directory).signals.items()},
    "same": bool((throw.joints.effort == simulated.joints.effort).all()),
}
"""
DERIVE = """
import throwcollect

throwcollect.split_dataset(directory, scratch / "parts", fractions="train=0.5,test=0.5")
throwcollect.merge_datasets([scratch / "parts/train", scratch / "parts/test"], scratch / "merged")
throwcollect.filter_dataset(directory, scratch / "some", where="trial < 3")
found = {
    "findings": [len(throwcollect.verify_dataset(scratch / name)) for name in ("parts/train", "merged", "some")],
    "replayed": len(throwcollect.verify_dataset(scratch / "merged", replay=2)),
    "trials": [len(throwcollect.load(scratch / name)) for name in ("merged", "some")],
}
"""
EXPORT = """
import json
import numpy as np
import throwcollect

for kind in ("parquet", "npz", "lerobot", "hdf5", "mat"):
    throwcollect.export_dataset(directory, scratch / kind, to=kind)
(arrays,) = map(np.load, (scratch / "npz/trajectories").iterdir())
features = json.loads((scratch / "lerobot/meta/info.json").read_text())
found = {
    "lerobot": [features["robot_type"], features["features"]["action"]["names"]],
    "npz": [arrays["joints"].tolist(), arrays["joint_effort_nm"].shape[1]],
    "cards": [(scratch / kind / "README.md").read_text().count("by the planar arm") for kind in ("parquet", "lerobot")],
}
"""


@pytest.fixture(scope="module")
def process() -> Iterator[ProcessPoolExecutor]:
    with process_with_plugins() as process:
        yield process


@pytest.fixture(scope="module")
def arm(process: ProcessPoolExecutor, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A dataset that nodes have collected."""
    scratch = tmp_path_factory.mktemp("arm")
    (scratch / "arm.yaml").write_text(CONFIG)
    summary = process.submit(collect, scratch / "arm.yaml", scratch / "data", 1, "--set", "run.replay=0").result()
    assert summary["outcomes"] == {"landed": 6}
    return scratch / "data"


@pytest.fixture
def say(process: ProcessPoolExecutor) -> Say:
    """A function that calls throwcollect where the package of the robot is installed."""
    return lambda *arguments: process.submit(call_here, *arguments).result()


@pytest.fixture
def run(process: ProcessPoolExecutor, arm: Path, tmp_path: Path) -> Run:
    """A function that runs a program which knows the dataset, and a directory for its results."""
    return lambda program: process.submit(run_program, program, directory=arm, scratch=tmp_path).result()


def test_nodes_and_one_process_write_the_same_files(say: Say, arm: Path, tmp_path: Path) -> None:
    done = say("up", arm.parent / "arm.yaml", "--runtime", "inprocess", "--output", tmp_path / "data")
    assert done.returncode == 0, done.stderr
    assert "2 trials simulated again in a fresh process: the same bit for bit" in done.stderr
    assert fingerprints(tmp_path / "data") == fingerprints(arm)
    assert "nothing wrong" in say("dataset", "verify", arm).stdout


def test_throws_of_the_second_robot_can_be_read_and_simulated_again(run: Run) -> None:
    found = run(READ)
    joints = ["shoulder_joint", "elbow_joint"]
    assert found["joints"] == [joints] * 4
    assert found["digests"][0] == found["digests"][1]
    assert found["same"]
    assert found["end"] == pytest.approx([1.4, 0.3], abs=1e-3)
    assert found["ends"] == [*found["end"], found["end"][1]]
    assert [found["statistics"][group] for group in ("position_rad", "velocity_radps", "effort_nm")] == [joints] * 3


def test_a_dataset_of_the_second_robot_can_be_derived_and_replayed(run: Run) -> None:
    assert run(DERIVE) == {"findings": [0, 0, 0], "replayed": 0, "trials": [6, 3]}


def test_a_dataset_of_the_second_robot_can_be_exported(run: Run) -> None:
    found = run(EXPORT)
    assert found["lerobot"] == ["planar_arm", ["shoulder_joint.pos", "elbow_joint.pos"]]
    assert found["npz"] == [["shoulder_joint", "elbow_joint"], 2]
    assert found["cards"] == [1, 1]


def test_a_dataset_of_the_second_robot_can_be_reported_and_viewed(say: Say, arm: Path, tmp_path: Path) -> None:
    reported = say("dataset", "report", arm, "--output", tmp_path / "report.html")
    assert reported.returncode == 0, reported.stderr
    assert "simulated throws of a ball by the planar arm" in (tmp_path / "report.html").read_text()
    viewed = say("dataset", "view", arm, tmp_path / "view")
    assert viewed.returncode == 0, viewed.stderr
    assert (tmp_path / "view" / "throws.mcap").stat().st_size > 0


def test_a_damaged_dataset_of_the_second_robot_can_be_mended(say: Say, arm: Path, tmp_path: Path) -> None:
    broken = tmp_path / "broken"
    shutil.copytree(arm, broken)
    (shard,) = broken.glob("*.mcap")
    # The summary at the end of the file is lost, and so is the table.
    shard.write_bytes(shard.read_bytes()[:-1000])
    (broken / "throws.parquet").unlink()
    assert say("dataset", "verify", broken).returncode != 0
    mended = say("resume", broken, "--no-simulate")
    assert mended.returncode == 0, mended.stderr
    assert fingerprints(broken) == fingerprints(arm)


def test_reading_a_dataset_without_the_package_of_its_robot_is_an_error(arm: Path) -> None:
    done = call_here("dataset", "info", arm)
    assert done.returncode == 2
    sentence = "robot.name: no robot 'planar_arm' is installed"
    assert sentence in done.stderr
    assert "Traceback" not in done.stderr
