"""A dataset carries the shapes of its bodies: everything works where their files are gone."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from pathlib import Path

import pytest
from tests.e2e.collection import INPROCESS, call_here, collect_here, write_config
from tests.unit.robots.test_body_files import write_box, write_l_shape

from throwcollect import verify_dataset
from throwcollect.config.loader import load
from throwcollect.config.scene import FileBodyConfig, MeshConfig
from throwcollect.config.values import with_sensors
from throwcollect.dataset.derive.derivation import filter_trials, merge, render_sensors
from throwcollect.dataset.inspect import info
from throwcollect.dataset.reader import Dataset
from throwcollect.publish.export.export import export
from throwcollect.robots.body_files import files_of

SHAPES = """\
name: shapes
trials: {trials}
scene:
  landing_height_m: 0.3
  bodies:
    table: {{shape: mesh, file: table.obj, scale: [0.001, 0.001, 0.001], position_m: [1.2, -0.9, 0.25]}}
    thing: {{shape: urdf, file: l_shape.urdf, mass_kg: 0.3, lies_on: table, position_m: [0.3, 0.6, 0.0]}}
sweep:
  sampler: uniform
  parameters: {{task.end.arm_right_4_joint: {{min: -0.7, max: -0.4}}, task.duration_s: {{min: 1.0, max: 1.2}}}}
run: {{replay: 0}}
"""


def write_sources(directory: Path) -> Path:
    directory.mkdir()
    write_box(directory / "table.obj", (0, 0, 0), (600, 1200, 50))
    write_l_shape(directory)
    return write_config(directory, trials=4, text=SHAPES, sim="engine: mujoco")


@pytest.fixture(scope="module")
def carrying(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A dataset whose sources lie elsewhere now."""
    pytest.importorskip("mujoco")
    place = tmp_path_factory.mktemp("shapes")
    collect_here(write_sources(place / "source"), place / "carrying")
    (place / "source").rename(place / "moved")
    return place / "carrying"


def test_a_dataset_is_verified_and_replayed_where_the_files_are_gone(carrying: Path) -> None:
    assert verify_dataset(carrying, replay=2) == []
    bodies = load(carrying / "config.yaml").scene.bodies.values()
    named = {Path(body.file).name for body in bodies if isinstance(body, FileBodyConfig)}
    there = {path.name for path in (carrying / "bodies").iterdir()}
    assert named < there
    assert len(there) == 3
    assert call_here("resume", carrying).returncode == 0
    assert call_here("dataset", "render", carrying, "-o", carrying.parent / "throw.png").returncode == 0


def test_the_same_shapes_from_elsewhere_are_the_same_collection(carrying: Path, tmp_path: Path) -> None:
    shutil.copytree(carrying.parent / "moved", tmp_path / "elsewhere")
    before = {name: (carrying / name).read_bytes() for name in ("config.yaml", "plan.parquet", "metadata.yaml")}
    done = call_here("up", tmp_path / "elsewhere" / "small.yaml", "--resume", carrying, *INPROCESS)
    assert done.returncode == 0, done.stderr
    assert {name: (carrying / name).read_bytes() for name in before} == before
    write_box(tmp_path / "elsewhere" / "table.obj", (0, 0, 0), (600, 1200, 51))
    done = call_here("up", tmp_path / "elsewhere" / "small.yaml", "--resume", carrying, *INPROCESS)
    assert (done.returncode, "scene.bodies.table.sha256" in done.stderr) == (2, True), done.stderr


def test_sensors_see_robots_and_shapes_where_their_files_are_now(
    carrying: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    camera = {"kind": "camera", "position_m": [1.2, -0.9, 3.0], "look_at_m": [1.2, -0.9, 0.2]}
    sections = {"top": {**camera, "streams": ["segmentation"]}}
    sensors = with_sensors(load(carrying / "config.yaml"), sections).sensors
    render_sensors(carrying, tmp_path / "seen", sensors)
    top = Dataset.open(tmp_path / "seen")[0].sensors["top"]
    assert (top.labels[0] == top.label_names.index("thing")).mean() > 0.005
    assert verify_dataset(tmp_path / "seen", replay=1) == []


@pytest.mark.parametrize(
    "derive",
    [
        lambda source, output: filter_trials(source, output, where="trial < 3"),
        lambda *each: merge([each[0]], each[1]),
        lambda source, output: export(source, output, to="npz"),
    ],
)
def test_what_is_made_of_it_carries_the_shapes(
    carrying: Path, tmp_path: Path, derive: Callable[[Path, Path], object]
) -> None:
    derive(carrying, tmp_path / "derived")
    for body in load(tmp_path / "derived" / "config.yaml").scene.bodies.values():
        assert isinstance(body, FileBodyConfig)
        assert Path(body.file).parent == tmp_path / "derived" / "bodies"
        assert files_of(body)
    if (tmp_path / "derived" / "plan.parquet").exists():
        assert verify_dataset(tmp_path / "derived", replay=1) == []


@pytest.mark.parametrize("damage", [Path.unlink, lambda path: path.write_bytes(path.read_bytes()[:-1])])
def test_a_shape_that_is_lost_comes_back_by_the_configuration(
    carrying: Path, tmp_path: Path, damage: Callable[[Path], object]
) -> None:
    dataset = tmp_path / "dataset"
    shutil.copytree(carrying, dataset)
    lost = min((dataset / "bodies").glob("*.stl"))
    damage(lost)
    assert f"bodies/{lost.name}" in {finding.file for finding in verify_dataset(dataset, replay=0)}
    done = call_here("up", carrying.parent / "moved" / "small.yaml", "--resume", dataset, *INPROCESS)
    assert done.returncode == 0, done.stderr
    assert verify_dataset(dataset, replay=1) == []


def test_another_shape_is_found_by_its_digest(carrying: Path, tmp_path: Path) -> None:
    dataset = tmp_path / "dataset"
    shutil.copytree(carrying, dataset)
    table = next(body for body in load(dataset / "config.yaml").scene.bodies.values() if isinstance(body, MeshConfig))
    write_box(Path(table.file), (0, 0, 0), (600, 1200, 51))
    findings = verify_dataset(dataset, replay=0)
    assert any("is not the file of the body's sha256" in finding.problem for finding in findings)


def test_the_digest_is_that_of_many_simulations(carrying: Path, tmp_path: Path) -> None:
    config = carrying.parent / "moved" / "small.yaml"
    done = call_here("up", "-n", "2", "--runtime", "local", config, "--output", tmp_path / "many")
    assert done.returncode == 0, done.stderr
    assert info(tmp_path / "many").digest == info(carrying).digest
