import re
from dataclasses import make_dataclass, replace
from pathlib import Path

import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from tests.unit.dataset.conftest import Collection

from throwcollect.config.schema import Config
from throwcollect.dataset.throws_table import ThrowsTable, find_row, read_throws
from throwcollect.episode.record import Contact, EpisodeHeader, Samples
from throwcollect.errors import ConfigError, DatasetError
from throwcollect.tasks.result_columns import Number, measured
from throwcollect.tasks.throw.throw_result import ThrowOutcome, ThrowResult
from throwcollect.tasks.throw.throw_task import ThrowTask


def hold_ball(samples: Samples, header: EpisodeHeader) -> tuple[Samples, EpisodeHeader]:
    return samples, replace(header, contacts=(Contact("spoon", header.start_ns, None),))


def not_finite(samples: Samples, header: EpisodeHeader) -> tuple[Samples, EpisodeHeader]:
    return replace(samples, effort=samples.effort * float("nan")), header


def test_rows_read_back_equal_from_the_table_of_throws(collection: Collection) -> None:
    table = ThrowsTable.of(collection.plan)
    outcomes = set()
    for change in (None, hold_ball, not_finite):
        result = collection.result(collection.episode(2, change))
        row = table.row(collection.plan.trials[2], result, {"shard": "a.mcap"})
        (stored,) = table.table([row]).to_pylist()
        assert {name: stored[name] for name in row} == row
        outcomes.add(result.outcome)
    assert outcomes == {ThrowOutcome.LANDED, ThrowOutcome.NOT_RELEASED, ThrowOutcome.TRACKING_FAILED}


def test_the_column_of_a_swept_key_needs_no_quotes_and_has_the_unit_of_the_key() -> None:
    swept = {
        "task.end.arm_right_4_joint": {"min": -0.7, "max": -0.4},
        "task.duration_s": {"min": 0.9, "max": 1.1},
        "ball.friction": {"min": 0.1, "max": 0.5},
        "scene.gravity_mps2": {"min": 9.7, "max": 9.9},
    }
    collection = Collection({"sweep": {"sampler": "uniform", "parameters": swept}})
    schema = ThrowsTable.of(collection.plan).schema
    units = {name: schema.field(name).metadata[b"unit"].decode() for name in schema.names[1 : 1 + len(swept)]}
    assert units == {
        "task_end_arm_right_4_joint": "rad",
        "task_duration_s": "s",
        "ball_friction": "1",
        "scene_gravity_mps2": "m/s^2",
    }
    assert schema.field("ball_friction").metadata[b"description"] == b"Swept value of ball.friction [-]."
    assert all(re.fullmatch("[A-Za-z][A-Za-z0-9_]*", name) for name in schema.names)


def test_a_task_with_a_result_named_like_another_column_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    column = "digest"
    results = make_dataclass(
        "Results", [(column, float, measured(Number("A number.")))], bases=(ThrowResult,), frozen=True
    )
    monkeypatch.setattr(ThrowTask, "results", results)
    with pytest.raises(ConfigError, match=f"table of throws of the task throw have the same name: {column}"):
        ThrowsTable((), Config())


def test_a_table_of_throws_without_one_of_its_columns_is_refused(collection: Collection, tmp_path: Path) -> None:
    directory = collection.collect(tmp_path / "dataset")
    table = pq.read_table(directory / "throws.parquet")
    (directory / "throws.parquet").unlink()
    pq.write_table(table.drop_columns(["recontacts"]), directory / "throws.parquet")
    with pytest.raises(DatasetError, match=r"not the table of this plan: differs in \['recontacts'\]"):
        read_throws(directory, collection.plan)


def test_the_row_of_a_trial_is_found_wherever_it_stands() -> None:
    table = pa.table({"trial": [4, None, 0, 2], "outcome": ["a", "b", "c", "d"]})
    for trial, outcome in {0: "c", 2: "d", 4: "a"}.items():
        assert find_row(table, trial) == {"trial": trial, "outcome": outcome}
    assert find_row(table, 1) is None
