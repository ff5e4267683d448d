from __future__ import annotations

from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest
from tests.unit.publish.export.conftest import MOVING, WITH_EPISODE, Export, table_of, throws_of

from throwcollect.dataset.inspect import info
from throwcollect.publish.export import parquet
from throwcollect.publish.export.export import export
from throwcollect.robots.talos import TALOS

COLUMNS = {
    "time_s": ["time_s"],
    "joint_position_rad": [f"{joint}_position_rad" for joint in TALOS.joints],
    "joint_velocity_radps": [f"{joint}_velocity_radps" for joint in TALOS.joints],
    "joint_effort_nm": [f"{joint}_effort_nm" for joint in TALOS.joints],
    "command_position_rad": [f"{joint}_command_position_rad" for joint in MOVING],
    "command_velocity_radps": [f"{joint}_command_velocity_radps" for joint in MOVING],
    "command_acceleration_radps2": [f"{joint}_command_acceleration_radps2" for joint in MOVING],
    "ball_position_m": ["ball_x_m", "ball_y_m", "ball_z_m"],
    "ball_orientation_xyzw": ["ball_qx", "ball_qy", "ball_qz", "ball_qw"],
    "ball_velocity_mps": ["ball_vx_mps", "ball_vy_mps", "ball_vz_mps"],
    "ball_angular_velocity_radps": ["ball_wx_radps", "ball_wy_radps", "ball_wz_radps"],
}


@pytest.mark.parametrize(("rate_hz", "step"), [(None, 1), (50, 5)])
def test_exported_samples_equal_those_of_the_dataset(
    rate_hz: int | None, step: int, exported: Export, source: Path
) -> None:
    samples = pq.read_table(exported("parquet", rate_hz) / "trajectories")
    assert samples.column_names == ["trial", *(name for names in COLUMNS.values() for name in names)]
    trials = samples["trial"].to_numpy()
    seen = 0
    for trial, signals in throws_of(source, step):
        rows = samples.filter(trials == trial)
        seen += len(rows)
        for signal, names in COLUMNS.items():
            found = np.column_stack([rows[name] for name in names])
            assert np.array_equal(found, signals[signal].reshape(len(rows), -1)), signal
    assert seen == len(samples)
    assert list(dict.fromkeys(trials.tolist())) == WITH_EPISODE


def test_the_exported_table_has_all_trials_with_units(exported: Export, source: Path) -> None:
    table = pq.read_table(exported("parquet") / "throws.parquet")
    assert table.to_pydict() == table_of(source)
    field = table.schema.field("landing_vz_mps")
    assert field.metadata[b"unit"] == b"m/s"
    assert field.metadata[b"description"].startswith(b"Velocity of the ball")
    assert table.schema.metadata[b"throwcollect.digest"] == info(source).digest.encode()


@pytest.mark.parametrize(("rows", "groups"), [(1, [[0], [2], [3], [4]]), (400, [[0, 2], [3, 4]])])
def test_a_throw_is_never_divided_between_row_groups(
    rows: int, groups: list[list[int]], source: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(parquet, "_ROWS_PER_GROUP", rows)
    export(source, tmp_path / "out", to="parquet")
    found = []
    for path in sorted((tmp_path / "out" / "trajectories").iterdir()):
        with pq.ParquetFile(path) as file:
            assert file.schema_arrow.field("ball_x_m").metadata[b"unit"] == b"m"
            columns = [file.read_row_group(number, columns=["trial"])["trial"] for number in range(file.num_row_groups)]
        found += [sorted(set(column.to_pylist())) for column in columns]
    assert found == groups
