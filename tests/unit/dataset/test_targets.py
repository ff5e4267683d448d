"""Datasets whose trials have targets: which files hold them, which checks find a change, which commands keep them."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.parquet as pq
import pytest
from tests.unit.dataset.conftest import Collection, create_and_open
from tests.unit.dataset.mutations import finish, fit_manifest
from tests.unit.dataset.targeted import LIST, WITHOUT_TARGETS, collect_targeted, plan_targeted

from throwcollect.cli.dataset.info import describe
from throwcollect.config.schema import Config
from throwcollect.config.task_config import TargetColumn
from throwcollect.dataset.derive.derivation import filter_trials, merge
from throwcollect.dataset.inspect import info
from throwcollect.dataset.misses import Misses
from throwcollect.dataset.reader import Dataset
from throwcollect.dataset.summary import MissSummary
from throwcollect.dataset.verify import verify
from throwcollect.dataset.writer import DatasetWriter
from throwcollect.episode.record import EpisodeHeader, Samples
from throwcollect.plan.parquet_file import encode_table
from throwcollect.publish.export.throw_source import ExportSource
from throwcollect.tasks.throw.throw_config import ThrowConfig


@pytest.fixture(scope="module")
def targeted(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return collect_targeted(tmp_path_factory.mktemp("targeted") / "data")


def hold_ball(samples: Samples, header: EpisodeHeader) -> tuple[Samples, EpisodeHeader]:
    return samples, replace(header, end_reason="timeout", contacts=(replace(header.contacts[0], end_ns=None),))


def test_a_throw_has_its_target_and_its_miss_is_the_distance(targeted: Path) -> None:
    dataset = Dataset.open(targeted)
    assert dataset.plan.keys == ("task.duration_s",)
    names = dataset.throws.column_names
    assert names[:5] == ["trial", "task_duration_s", "target_x_m", "target_y_m", "outcome"]
    assert [throw.target for throw in dataset] == [
        {"target_x_m": 1.4, "target_y_m": -0.1},
        {},
        {"target_x_m": 1.5, "target_y_m": 0.2},
        {"target_x_m": 1.6, "target_y_m": 0.1},
    ]
    for throw in dataset:
        x, y = throw.row["landing_x_m"], throw.row["landing_y_m"]
        if throw.target:
            away = np.hypot(x - throw.target["target_x_m"], y - throw.target["target_y_m"])
            assert throw.miss_m == pytest.approx(away, rel=1e-12)
        else:
            assert throw.miss_m is None
    for name in ("plan.parquet", "trials.parquet", "throws.parquet"):
        assert pq.read_table(targeted / name)["target_y_m"].to_pylist() == [-0.1, None, 0.2, 0.1]
    assert verify(targeted) == []


def test_a_throw_that_did_not_land_has_no_miss(tmp_path: Path) -> None:
    dataset = Dataset.open(collect_targeted(tmp_path / "data", change=hold_ball))
    assert {throw.outcome for throw in dataset} == {"not_released"}
    assert [throw.miss_m for throw in dataset] == [None] * 4
    found = info(tmp_path / "data").misses
    assert found == {"miss_m": MissSummary(3, 0, None, None, None)}
    assert "miss_m    0 of 3 targets\n" in describe(info(tmp_path / "data"))


def test_targets_can_have_a_height_and_a_hit_angle(tmp_path: Path) -> None:
    columns = "scene.landing_height_m,target_x_m,target_y_m,target_z_m,target_hit_angle_rad\n"
    text = columns + "0.25,1.4,-0.1,0.25,1.2\n0.25,1.4,-0.1,0.5,\n0.25,1.4,-0.1,,1.2\n"
    dataset = Dataset.open(collect_targeted(tmp_path / "data", text))
    rows = dataset.throws.to_pylist()
    level = [np.hypot(row["landing_x_m"] - 1.4, row["landing_y_m"] + 0.1) for row in rows]
    expected = [level[0], np.hypot(level[1], 0.25), level[2]]
    assert [row["miss_m"] for row in rows] == pytest.approx(expected, rel=1e-12)
    angles = [row["miss_hit_angle_rad"] for row in rows]
    assert angles[1] is None
    assert [angles[0], angles[2]] == pytest.approx([abs(rows[n]["hit_angle_rad"] - 1.2) for n in (0, 2)], rel=1e-12)
    text = "task.duration_s,target_x_m,target_y_m,target_z_m\n1,1.4,0,0.5\n"
    fixed = collect_targeted(tmp_path / "fixed", text, height_m=0.2)
    (row,) = Dataset.open(fixed).throws.to_pylist()
    assert row["miss_m"] == pytest.approx(np.sqrt((row["landing_x_m"] - 1.4) ** 2 + row["landing_y_m"] ** 2 + 0.09))


def test_a_task_defines_the_columns_of_its_targets_and_misses() -> None:
    class Timed(ThrowConfig):
        target_columns = (
            TargetColumn("target_flight_s", "flight_time_s", "miss_s", "flight", "Time [s].", required=True),
        )

    misses = Misses(Config().model_copy(update={"task": Timed()}), ["target_flight_s"])
    assert misses.descriptions == {"miss_s": "Distance of where the trial ended from its target, in flight [s]."}
    assert misses.measure({"target_flight_s": 0.75}, {"flight_time_s": 0.5}) == {"miss_s": 0.25}
    assert misses.measure({"target_flight_s": 0.75}, {"flight_time_s": None}) == {"miss_s": None}
    assert misses.measure({}, {"flight_time_s": 0.5}) == {"miss_s": None}


def test_targets_change_the_digest_of_the_dataset_but_no_episode(targeted: Path, tmp_path: Path) -> None:
    plain = collect_targeted(tmp_path / "plain", WITHOUT_TARGETS)
    other = collect_targeted(tmp_path / "other", LIST.replace("1.6", "1.61"))
    shards = [sorted(path.glob("*.mcap")) for path in (targeted, plain, other)]
    recorded = {tuple(path.read_bytes() for path in found) for found in shards}
    assert len(recorded) == 1
    plans = [Dataset.open(path).plan.trials for path in (targeted, plain, other)]
    assert len({trials.digests.tobytes() for trials in plans}) == 1
    digests = [info(path).digest for path in (targeted, plain, other)]
    assert len(set(digests)) == 3
    assert "target_x_m" not in pq.read_schema(plain / "plan.parquet").names
    assert digests[1] == Dataset.open(plain).digest


def in_throws(directory: Path) -> None:
    change(directory / "throws.parquet", "target_x_m")


def in_misses(directory: Path) -> None:
    change(directory / "throws.parquet", "miss_m")


def in_plan(directory: Path) -> None:
    change(directory / "plan.parquet", "target_x_m")


def in_list(directory: Path) -> None:
    change(directory / "trials.parquet", "target_x_m")


def everywhere(directory: Path) -> None:
    for name in ("throws.parquet", "plan.parquet", "trials.parquet"):
        change(directory / name, "target_x_m")


def change(path: Path, column: str) -> None:
    table = pq.read_table(path)
    index = table.column_names.index(column)
    values = pc.add(table[column], pa.scalar(0.01))
    path.write_bytes(encode_table(table.set_column(index, table.schema.field(column), values)))


@pytest.mark.parametrize(
    ("forge", "finding"),
    [
        (in_throws, "quick_00000.mcap: trial 0: throws.parquet has target_x_m = 1.41 instead of 1.4"),
        (in_misses, "quick_00000.mcap: trial 0: throws.parquet has miss_m = "),
        (in_plan, "trials.parquet: begins with other points than those of plan.parquet"),
        (in_list, "trials.parquet: begins with other points than those of plan.parquet"),
        (everywhere, "quick_00000.mcap: trial 0: throws.parquet has miss_m = "),
    ],
)
def test_a_changed_target_is_found(targeted: Path, tmp_path: Path, forge: Callable[[Path], None], finding: str) -> None:
    directory = Path(shutil.copytree(targeted, tmp_path / "data"))
    forge(directory)
    fit_manifest(directory)
    found = [str(each) for each in verify(directory)]
    assert any(each.startswith(finding) for each in found), found


@pytest.mark.parametrize("damaged", ["plan.parquet", "trials.parquet"])
def test_a_mended_dataset_has_the_targets_and_the_list(targeted: Path, tmp_path: Path, damaged: str) -> None:
    directory = Path(shutil.copytree(targeted, tmp_path / "data"))
    (directory / damaged).write_bytes(b"PAR1")
    if damaged == "trials.parquet":
        # Of a dataset that is not finished, too.
        (directory / "metadata.yaml").unlink()
    finish(directory)
    assert verify(directory) == []
    for name in ("throws.parquet", "plan.parquet", "trials.parquet", "metadata.yaml"):
        assert (directory / name).read_bytes() == (targeted / name).read_bytes(), name


def test_a_resumed_collection_keeps_its_targets(targeted: Path, tmp_path: Path) -> None:
    collection = plan_targeted(tmp_path / "data")
    shutil.copy(targeted / "trials.parquet", tmp_path / "trials.parquet")
    writer = create_and_open(tmp_path / "data", collection.plan)
    shutil.copy(targeted / "trials.parquet", tmp_path / "data" / "trials.parquet")
    collection.fill(writer, [0, 3])
    writer.close()
    writer = DatasetWriter.open(tmp_path / "data")
    assert writer.recover() == 2
    collection.fill(writer, [1, 2])
    writer.finish()
    writer.close()
    for name in ("throws.parquet", "plan.parquet", "metadata.yaml"):
        assert (tmp_path / "data" / name).read_bytes() == (targeted / name).read_bytes(), name


def test_merged_throws_keep_their_targets(targeted: Path, tmp_path: Path) -> None:
    Collection().collect(tmp_path / "plain")
    merge([tmp_path / "plain", targeted], tmp_path / "both")
    merged = Dataset.open(tmp_path / "both")
    assert verify(tmp_path / "both") == []
    before = [throw.target for throw in Dataset.open(targeted)]
    assert [throw.target for throw in merged] == [{}] * 7 + before
    assert [throw.miss_m for throw in merged][7:] == [throw.miss_m for throw in Dataset.open(targeted)]
    assert merged.throws["target_x_m"].null_count == 8
    assert ExportSource(Dataset.open(tmp_path / "both"), {}).targets == ()
    filter_trials(tmp_path / "both", tmp_path / "some", where="miss_m >= 0")
    some = ExportSource(Dataset.open(tmp_path / "some"), {})
    assert [each.name for each in some.targets] == ["target_x_m", "target_y_m"]
    assert verify(tmp_path / "some") == []
    filter_trials(tmp_path / "both", tmp_path / "none", where="trial < 7")
    assert [throw.target for throw in Dataset.open(tmp_path / "none")] == [{}] * 7
