"""A dataset carries its motions and the shapes of its bodies: everything works where their files are gone."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pyarrow.compute as pc
import pyarrow.parquet as pq
import pytest
from tests.e2e.collection import FAST, INPROCESS, call_here, collect_here, write_config
from tests.unit.robots.test_body_files import write_box, write_l_shape

from throwcollect import verify_dataset
from throwcollect.config.loader import load
from throwcollect.config.scene import FileBodyConfig
from throwcollect.config.values import with_sensors
from throwcollect.dataset.derive.derivation import filter_trials, merge, render_sensors
from throwcollect.dataset.inspect import info
from throwcollect.dataset.reader import Dataset
from throwcollect.publish.export.export import export
from throwcollect.robots.body_files import files_of
from throwcollect.robots.description import robot_of
from throwcollect.tasks.motions import motions_of

SHAPES = """\
name: drawn
scene:
  landing_height_m: 0.3
  bodies:
    table: {{shape: mesh, file: table.obj, scale: [0.001, 0.001, 0.001], position_m: [1.2, -0.9, 0.25]}}
    thing: {{shape: urdf, file: l_shape.urdf, mass_kg: 0.3, lies_on: table, position_m: [0.3, 0.6, 0.0]}}
run: {{replay: 0}}
"""
DRAWN = (
    f"{SHAPES}trials: {{trials}}\n"
    + """\
sweep:
  sampler: uniform
  parameters: {{task.end.arm_right_4_joint: {{min: -0.7, max: -0.4}}, task.duration_s: {{min: 1.0, max: 1.2}}}}
"""
)
MOTIONS = "task: {{trajectory: {{family: file, file: points/motions}}}}\n"
OF_A_DMP = """\
name: drawn
trials: {trials}
task:
  end: {{arm_right_4_joint: -0.5}}
  trajectory:
    family: dmp
    basis_functions: 12
    weights:
      arm_right_4_joint: [-758, -994, -1122, -1231, -1231, -1114, -858, -509, -156, 74, 58, -57]
sweep: {{parameters: {{task.end.arm_right_4_joint: {{min: -0.55, max: -0.5}}}}}}
run: {{replay: 0}}
"""


def write_sources(directory: Path, text: str, *, trials: int) -> Path:
    directory.mkdir(exist_ok=True)
    write_box(directory / "table.obj", (0, 0, 0), (600, 1200, 50))
    write_l_shape(directory)
    return write_config(directory, trials=trials, text=text, sim="engine: mujoco")


@pytest.fixture(scope="module")
def place(tmp_path_factory: pytest.TempPathFactory) -> Path:
    pytest.importorskip("mujoco")
    return tmp_path_factory.mktemp("carried")


@pytest.fixture(scope="module")
def drawn(place: Path) -> Path:
    collect_here(write_sources(place / "first", DRAWN, trials=4), place / "drawn")
    return place / "drawn"


@pytest.fixture(scope="module")
def carrying(drawn: Path, place: Path) -> Path:
    """A dataset of files that lie elsewhere now; its motions were exported from another dataset."""
    source = place / "source"
    source.mkdir()
    export(drawn, source / "points", to="parquet")
    collect_here(write_sources(source, SHAPES + MOTIONS, trials=0), place / "carrying")
    source.rename(place / "moved")
    return place / "carrying"


@pytest.fixture
def elsewhere(carrying: Path, place: Path, tmp_path: Path) -> Path:
    """Another copy of its files."""
    assert carrying.exists()
    return Path(shutil.copytree(place / "moved", tmp_path / "elsewhere"))


def test_throws_whose_points_were_exported_are_the_same_bit_for_bit(drawn: Path, carrying: Path) -> None:
    assert info(carrying).digest == info(drawn).digest
    for one, other in zip(Dataset.open(drawn).episodes(), Dataset.open(carrying).episodes(), strict=True):
        assert np.array_equal(one.samples().object_position, other.samples().object_position)
    # The plans differ, as the second one varies the motion.
    assert "task.trajectory.motion" in Dataset.open(carrying).plan.keys


def test_points_of_dmps_begin_with_any_acceleration(tmp_path: Path) -> None:
    collect_here(write_config(tmp_path, trials=2, text=OF_A_DMP, sim=FAST), tmp_path / "drawn")
    export(tmp_path / "drawn", tmp_path / "points", to="parquet")
    text = f"name: drawn\n{MOTIONS}run: {{{{replay: 0}}}}\n"
    collect_here(write_config(tmp_path, trials=0, text=text, sim=FAST), tmp_path / "again")
    assert info(tmp_path / "again").digest == info(tmp_path / "drawn").digest


def test_it_is_verified_and_replayed_where_the_files_are_gone(carrying: Path) -> None:
    assert verify_dataset(carrying, replay=2) == []
    assert "    file: motions.parquet\n" in (carrying / "config.yaml").read_text()
    bodies = load(carrying / "config.yaml").scene.bodies.values()
    named = {Path(body.file).name for body in bodies if isinstance(body, FileBodyConfig)}
    there = {path.name for path in (carrying / "bodies").iterdir()}
    assert named < there
    assert len(there) == 3
    assert call_here("resume", carrying).returncode == 0
    assert call_here("dataset", "render", carrying, "-o", carrying.parent / "throw.png").returncode == 0


def test_a_collection_goes_on_with_the_same_files_wherever_they_are(carrying: Path, elsewhere: Path) -> None:
    before = {name: (carrying / name).read_bytes() for name in ("config.yaml", "plan.parquet", "metadata.yaml")}
    done = call_here("up", elsewhere / "small.yaml", "--resume", carrying, *INPROCESS)
    assert done.returncode == 0, done.stderr
    assert {name: (carrying / name).read_bytes() for name in before} == before


def lose_motion(directory: Path) -> None:
    points = directory / "points" / "motions" / "drawn_00000.parquet"
    table = pq.read_table(points)
    pq.write_table(table.filter(pc.not_equal(table["motion"], "3")), points)


def grow_table(directory: Path) -> None:
    write_box(directory / "table.obj", (0, 0, 0), (600, 1200, 51))


@pytest.mark.parametrize(
    ("change", "key"), [(lose_motion, "task.trajectory.sha256"), (grow_table, "scene.bodies.table.sha256")]
)
def test_a_collection_does_not_go_on_with_other_files(
    carrying: Path, elsewhere: Path, change: Callable[[Path], None], key: str
) -> None:
    change(elsewhere)
    done = call_here("up", elsewhere / "small.yaml", "--resume", carrying, *INPROCESS)
    assert (done.returncode, key in done.stderr) == (2, True), done.stderr


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
def test_what_is_made_of_it_carries_the_files(
    carrying: Path, tmp_path: Path, derive: Callable[[Path, Path], object]
) -> None:
    derive(carrying, tmp_path / "derived")
    config = load(tmp_path / "derived" / "config.yaml")
    assert motions_of(config.task.trajectory, robot_of(config)).names == ("0", "1", "2", "3")
    for body in config.scene.bodies.values():
        assert isinstance(body, FileBodyConfig)
        assert Path(body.file).parent == tmp_path / "derived" / "bodies"
        assert files_of(body)
    if (tmp_path / "derived" / "plan.parquet").exists():
        assert verify_dataset(tmp_path / "derived", replay=1) == []


@pytest.mark.parametrize("pattern", ["motions.parquet", "bodies/*.stl"])
@pytest.mark.parametrize("damage", [Path.unlink, lambda path: path.write_bytes(path.read_bytes()[:-1])])
def test_files_that_are_lost_come_back_by_the_configuration(
    carrying: Path, place: Path, tmp_path: Path, damage: Callable[[Path], object], pattern: str
) -> None:
    dataset = tmp_path / "dataset"
    shutil.copytree(carrying, dataset)
    lost = min(dataset.glob(pattern))
    damage(lost)
    assert str(lost.relative_to(dataset)) in {finding.file for finding in verify_dataset(dataset, replay=0)}
    done = call_here("up", place / "moved" / "small.yaml", "--resume", dataset, *INPROCESS)
    assert done.returncode == 0, done.stderr
    assert verify_dataset(dataset, replay=1) == []


def test_the_digest_is_that_of_many_simulations(carrying: Path, place: Path, tmp_path: Path) -> None:
    done = call_here(
        "up", "-n", "2", "--runtime", "local", place / "moved" / "small.yaml", "--output", tmp_path / "many"
    )
    assert done.returncode == 0, done.stderr
    assert info(tmp_path / "many").digest == info(carrying).digest
