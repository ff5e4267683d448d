"""A dataset carries its robot: everything works where the source of the robot is gone, and at another path."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from pathlib import Path

import pytest
from tests.e2e.collection import FAST, call_here, collect_here
from tests.e2e.collection import write_config as write_user_config

from throwcollect import Simulator, fit, load_model, verify_dataset
from throwcollect.config.loader import load
from throwcollect.dataset.carried_robot import carry_robot, pack_robot, unpack_robot
from throwcollect.dataset.derive.derivation import filter_trials, merge
from throwcollect.dataset.reader import Dataset
from throwcollect.publish.export.export import export
from throwcollect.publish.view.animation import render
from throwcollect.publish.view.viewer_directory import view
from throwcollect.robots.imported import hash_files
from throwcollect.state_directory import STATE_VARIABLE

PANDA = """\
name: small
trials: {trials}
robot: {{name: panda}}
task:
  duration_s: 1.1
  start: {{panda_joint1: -1.61, panda_joint2: 0.69, panda_joint3: -0.17, panda_joint4: -0.51, panda_joint5: 1.25,
    panda_joint6: 2.39, panda_joint7: -1.07}}
  end: {{panda_joint2: -0.37, panda_joint5: 0.03, panda_joint6: 3.70}}
sweep:
  sampler: uniform
  parameters: {{task.end.panda_joint6: {{min: 3.5, max: 3.7}}, task.duration_s: {{min: 1.1, max: 1.4}}}}
run: {{replay: 0}}
"""


@pytest.fixture(scope="module")
def place(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("carried")


@pytest.fixture(scope="module")
def carrying(place: Path) -> Path:
    """A dataset that was moved, and whose robot was imported on a machine that is gone."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv(STATE_VARIABLE, str(place / "state"))
        collect_here(write_user_config(place, trials=24, text=PANDA, sim=FAST), place / "made")
    shutil.rmtree(place / "state")
    # Such a name has to be quoted in XML.
    return (place / "made").rename(place / "moved & 'quoted'")


@pytest.fixture(autouse=True)
def _fresh_machine(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(STATE_VARIABLE, str(tmp_path / "state"))


def list_places(directory: Path, *, of: Path) -> list[Path]:
    """The files in which the path of a directory is written."""
    files = [path for path in directory.rglob("*") if path.is_file() and "logs" not in path.parts]
    return [path for path in files if str(of).encode() in path.read_bytes()]


def test_it_is_verified_and_replayed_and_names_no_path(carrying: Path, place: Path, tmp_path: Path) -> None:
    assert verify_dataset(carrying, replay=2) == []
    assert Dataset.open(carrying).config.robot.name == "panda"
    assert list_places(carrying, of=place) == []
    # Nothing was imported again.
    assert not (tmp_path / "state" / "robots").exists()


def test_it_is_drawn(carrying: Path, place: Path, tmp_path: Path) -> None:
    assert render(carrying, tmp_path / "throw.png", size=(96, 72)).pictures == 1
    view(carrying, tmp_path / "view", [0])
    assert list((tmp_path / "view" / "panda_description").glob("*.dae"))
    assert list_places(tmp_path / "view", of=place) == []


@pytest.mark.parametrize(
    "derive",
    [lambda source, output: filter_trials(source, output, where="trial < 3"), lambda *each: merge([each[0]], each[1])],
)
def test_what_is_derived_from_it_carries_the_robot(
    carrying: Path, tmp_path: Path, derive: Callable[[Path, Path], object]
) -> None:
    derive(carrying, tmp_path / "derived")
    assert verify_dataset(tmp_path / "derived", replay=1) == []
    assert "  urdf: robot/robot.urdf\n" in (tmp_path / "derived" / "config.yaml").read_text()


@pytest.mark.parametrize("kind", ["hdf5", "npz"])
def test_an_export_carries_the_robot(carrying: Path, place: Path, tmp_path: Path, kind: str) -> None:
    export(carrying, tmp_path / "out", to=kind)
    assert load(tmp_path / "out" / "config.yaml").robot.find().directory == tmp_path / "out" / "robot"
    assert list_places(tmp_path / "out", of=place) == []


def test_a_model_carries_the_robot_of_its_dataset(carrying: Path, place: Path, tmp_path: Path) -> None:
    fit(carrying).save(tmp_path / "first")
    load_model(tmp_path / "first").save(tmp_path / "model")
    shutil.rmtree(tmp_path / "first")
    assert list_places(tmp_path / "model", of=place) == []
    with Simulator(tmp_path / "model" / "config.yaml") as simulator:
        assert load_model(tmp_path / "model").score(simulator, targets=2, seeds=1).throws


def test_files_of_a_robot_that_are_lost_come_back_by_the_configuration(carrying: Path, tmp_path: Path) -> None:
    dataset = tmp_path / "dataset"
    shutil.copytree(carrying, dataset)
    lost = min((dataset / "robot").glob("*.stl"))
    lost.unlink()
    (finding,) = verify_dataset(dataset, replay=1)
    assert finding.file == f"robot/{lost.name}"
    # Its own configuration cannot bring them back, and nothing is changed.
    assert call_here("resume", dataset).returncode == 2
    assert (dataset / "metadata.yaml").exists()
    config = write_user_config(tmp_path, trials=24, text=PANDA, sim=FAST)
    done = call_here("up", config, "--resume", dataset, "--runtime", "inprocess")
    assert (done.returncode, lost.exists()) == (0, True), done.stderr
    assert verify_dataset(dataset, replay=1) == []


def test_files_of_a_robot_pass_as_a_text_to_another_machine(carrying: Path, tmp_path: Path) -> None:
    unpack_robot(pack_robot(Dataset.open(carrying).config), tmp_path)
    assert hash_files(tmp_path / "robot") == hash_files(carrying / "robot")


def test_the_files_of_an_installed_robot_are_not_carried(tmp_path: Path) -> None:
    (tmp_path / "talos.yaml").write_text("trials: 1\n")
    config = load(tmp_path / "talos.yaml")
    assert carry_robot(config, tmp_path) is config
    assert pack_robot(config) == ""
    unpack_robot("", tmp_path)
    assert not (tmp_path / "robot").exists()
