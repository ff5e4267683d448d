"""A dataset carries its motions: everything works where their file is gone, and throws are made again from points."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pyarrow.compute as pc
import pyarrow.parquet as pq
import pytest
from tests.e2e.collection import FAST, INPROCESS, call_here, collect_here, write_config

from throwcollect import verify_dataset
from throwcollect.config.loader import load
from throwcollect.dataset.derive.derivation import filter_trials, merge
from throwcollect.dataset.inspect import info
from throwcollect.dataset.reader import Dataset
from throwcollect.publish.export.export import export
from throwcollect.robots.description import robot_of
from throwcollect.tasks.motions import motions_of

DRAWN = """\
name: drawn
trials: {trials}
sweep:
  sampler: uniform
  parameters: {{task.end.arm_right_4_joint: {{min: -0.7, max: -0.4}}, task.duration_s: {{min: 1.0, max: 1.2}}}}
run: {{replay: 0}}
"""
OF_A_FILE = """\
name: drawn
task: {{trajectory: {{family: file, file: points/motions}}}}
run: {{replay: 0}}
"""


@pytest.fixture(scope="module")
def place(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("motions")


@pytest.fixture(scope="module")
def drawn(place: Path) -> Path:
    collect_here(write_config(place, trials=4, text=DRAWN, sim=FAST), place / "drawn")
    return place / "drawn"


@pytest.fixture(scope="module")
def carrying(drawn: Path, place: Path) -> Path:
    """A dataset of motions of a file that is gone; they were exported from another dataset."""
    source = place / "source"
    source.mkdir()
    export(drawn, source / "points", to="parquet")
    collect_here(write_config(source, trials=0, text=OF_A_FILE, sim=FAST), place / "carrying")
    source.rename(place / "moved")
    return place / "carrying"


def test_throws_whose_points_were_exported_are_the_same_bit_for_bit(drawn: Path, carrying: Path) -> None:
    assert info(carrying).digest == info(drawn).digest
    for one, other in zip(Dataset.open(drawn).episodes(), Dataset.open(carrying).episodes(), strict=True):
        assert np.array_equal(one.samples().object_position, other.samples().object_position)
    # The plans differ, as the second one varies the motion.
    assert "task.trajectory.motion" in Dataset.open(carrying).plan.keys


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


def test_points_of_dmps_begin_with_any_acceleration(place: Path) -> None:
    source = place / "dmp"
    source.mkdir()
    collect_here(write_config(source, trials=2, text=OF_A_DMP, sim=FAST), source / "drawn")
    export(source / "drawn", source / "points", to="parquet")
    collect_here(write_config(source, trials=0, text=OF_A_FILE, sim=FAST), source / "again")
    assert info(source / "again").digest == info(source / "drawn").digest


def test_it_is_verified_and_replayed_where_the_file_is_gone(carrying: Path) -> None:
    assert verify_dataset(carrying, replay=2) == []
    assert "    file: motions.parquet\n" in (carrying / "config.yaml").read_text()
    assert call_here("resume", carrying).returncode == 0


def test_a_collection_goes_on_with_the_same_motions_wherever_they_are(
    carrying: Path, place: Path, tmp_path: Path
) -> None:
    shutil.copytree(place / "moved", tmp_path / "elsewhere")
    before = {name: (carrying / name).read_bytes() for name in ("config.yaml", "plan.parquet", "metadata.yaml")}
    done = call_here("up", tmp_path / "elsewhere" / "small.yaml", "--resume", carrying, *INPROCESS)
    assert done.returncode == 0, done.stderr
    assert {name: (carrying / name).read_bytes() for name in before} == before


def test_a_collection_does_not_go_on_with_other_motions(carrying: Path, place: Path, tmp_path: Path) -> None:
    shutil.copytree(place / "moved", tmp_path / "elsewhere")
    points = tmp_path / "elsewhere" / "points" / "motions" / "drawn_00000.parquet"
    table = pq.read_table(points)
    pq.write_table(table.filter(pc.not_equal(table["motion"], "3")), points)
    done = call_here("up", tmp_path / "elsewhere" / "small.yaml", "--resume", carrying, *INPROCESS)
    assert (done.returncode, "task.trajectory.sha256" in done.stderr) == (2, True), done.stderr


@pytest.mark.parametrize(
    "derive",
    [
        lambda source, output: filter_trials(source, output, where="trial < 3"),
        lambda *each: merge([each[0]], each[1]),
        lambda source, output: export(source, output, to="npz"),
    ],
)
def test_what_is_made_of_it_carries_the_motions(
    carrying: Path, tmp_path: Path, derive: Callable[[Path, Path], object]
) -> None:
    derive(carrying, tmp_path / "derived")
    family = load(tmp_path / "derived" / "config.yaml").task.trajectory
    assert motions_of(family, robot_of(Dataset.open(carrying).config)).names == ("0", "1", "2", "3")
    if (tmp_path / "derived" / "plan.parquet").exists():
        assert verify_dataset(tmp_path / "derived", replay=1) == []


@pytest.mark.parametrize("damage", [Path.unlink, lambda path: path.write_bytes(path.read_bytes()[:-1])])
def test_motions_that_are_lost_come_back_by_the_configuration(
    carrying: Path, place: Path, tmp_path: Path, damage: Callable[[Path], object]
) -> None:
    dataset = tmp_path / "dataset"
    shutil.copytree(carrying, dataset)
    damage(dataset / "motions.parquet")
    assert {finding.file for finding in verify_dataset(dataset, replay=0)} == {"motions.parquet"}
    done = call_here("up", place / "moved" / "small.yaml", "--resume", dataset, *INPROCESS)
    assert done.returncode == 0, done.stderr
    assert verify_dataset(dataset, replay=1) == []
