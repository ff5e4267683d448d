"""An arm that only its URDF describes: the same dataset, wherever and however it is collected."""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.e2e.collection import INPROCESS, call_here, collect_here, fingerprints, start
from throwcollect.robots.imported import hash_files
from throwcollect.state_directory import STATE_VARIABLE

pytestmark = pytest.mark.e2e

TRIALS = 4
KINOVA = """\
name: kinova
seed: 1
robot:
  urdf: "example-robot-data:kinova_description/robots/kinova.urdf"
  name: kinova
  flange: j2s6s200_end_effector
task:
  duration_s: 2.561
  start:
    j2s6s200_joint_1: -1.2817
    j2s6s200_joint_2: 2.2909
    j2s6s200_joint_3: 2.3555
    j2s6s200_joint_4: -0.5783
    j2s6s200_joint_5: 3.012
    j2s6s200_joint_6: 1.1801
  end: {j2s6s200_joint_1: -0.7537, j2s6s200_joint_2: 2.9762, j2s6s200_joint_3: 1.6241}
sweep:
  parameters:
    task.end.j2s6s200_joint_3: {min: 1.524, max: 1.724}
    task.duration_s: {min: 2.561, max: 2.945}
"""
"""Its URDF has continuous joints, meshes in COLLADA and a hand; no robot of this name is installed."""


def describe_files(directory: Path) -> dict[str, str]:
    """Digests of the files of a dataset and of its robot."""
    return {**fingerprints(directory), "robot": hash_files(directory / "robot")}


@pytest.fixture
def elsewhere(tmp_path: Path) -> Iterator[Path]:
    """A directory whose users have imported nothing yet."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv(STATE_VARIABLE, str(tmp_path / "empty"))
        yield tmp_path / "elsewhere"


def test_a_dataset_of_an_arm_is_the_same_after_a_kill_and_from_its_own_files(tmp_path: Path, elsewhere: Path) -> None:
    config = tmp_path / "kinova.yaml"
    config.write_text(KINOVA)
    settings = [f"trials={TRIALS}", "sim.engine=mujoco", "run.replay=0"]
    options = [word for each in settings for word in ("--set", each)]
    summary = collect_here(config, tmp_path / "whole", *options)
    expected = describe_files(tmp_path / "whole")
    assert summary["outcomes"] == {"landed": TRIALS}

    running = start(config, tmp_path / "killed", 2, *options)
    whole = sum(path.stat().st_size for path in (tmp_path / "whole").glob("*.mcap"))
    running.wait_until(lambda: running.count_bytes() > 0.3 * whole)
    for process in (*running.nodes(), running.process):
        process.kill()
    running.finish()
    assert not (tmp_path / "killed" / "throws.parquet").exists()
    resumed = call_here("resume", tmp_path / "killed", *INPROCESS)
    assert resumed.returncode == 0, resumed.stderr
    assert describe_files(tmp_path / "killed") == expected

    # Nothing but the configuration and the robot of the dataset is left.
    elsewhere.mkdir()
    shutil.copy(tmp_path / "whole" / "config.yaml", elsewhere)
    shutil.copytree(tmp_path / "whole" / "robot", elsewhere / "robot")
    for gone in ("whole", "killed", "empty"):
        shutil.rmtree(tmp_path / gone, ignore_errors=True)
    collect_here(elsewhere / "config.yaml", elsewhere / "data", "--set", "run.replay=0")
    assert describe_files(elsewhere / "data") == expected
    assert not list((tmp_path / "empty").glob("robots/*"))
