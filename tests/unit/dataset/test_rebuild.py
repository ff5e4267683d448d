"""Rebuild restores files that follow from others byte for byte."""

from __future__ import annotations

import shutil
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from throwcollect.dataset.rebuild import NO_EPISODE, rebuild
from throwcollect.dataset.throws_table import Row, ThrowsTable
from throwcollect.dataset.verify import verify
from throwcollect.errors import DatasetError

DERIVED = ("throws.parquet", "datapackage.json", "metadata.yaml")


@pytest.fixture(scope="module")
def mixed(make_module_collection: Any, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A dataset with a refused and two lost trials; one of the lost ones is alone in its shard."""
    collection = make_module_collection()
    collection.refuse(1, "arm_right_1_joint: too fast")
    directory = tmp_path_factory.mktemp("mixed") / "dataset"
    return Path(collection.collect(directory, [0, 2, 3, 4, 5, 6], lost=[4, 6]))


@pytest.fixture(scope="module")
def make_module_collection() -> Any:
    from tests.unit.dataset.conftest import Collection

    return Collection


@pytest.fixture
def spoiled(mixed: Path, tmp_path: Path) -> Path:
    return Path(shutil.copytree(mixed, tmp_path / "spoiled"))


def test_rebuild_restores_derived_files_byte_for_byte(mixed: Path, spoiled: Path) -> None:
    (spoiled / "metadata.yaml").unlink()
    (spoiled / "README.md").unlink()
    (spoiled / "provenance.json").unlink()
    rebuilt = rebuild(spoiled)
    assert (rebuilt.trials, rebuilt.episodes, rebuilt.lost) == (7, 4, (4, 6))
    assert rebuilt.written == (*DERIVED, "README.md")
    for name in DERIVED:
        assert (spoiled / name).read_bytes() == (mixed / name).read_bytes()
    assert "wall time" not in (spoiled / "README.md").read_text()
    assert verify(spoiled) == []


def test_rebuild_holds_the_rows_of_one_recording_at_a_time(spoiled: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    made, counts = ThrowsTable.table, []

    def count_rows(table: ThrowsTable, rows: Iterable[Row]) -> pa.Table:
        rows = list(rows)
        counts.append(len(rows))
        return made(table, rows)

    monkeypatch.setattr(ThrowsTable, "table", count_rows)
    rebuild(spoiled)
    assert counts == [3, 3, 1]


def test_rebuild_restores_the_data_card_from_the_provenance(mixed: Path, spoiled: Path) -> None:
    (spoiled / "README.md").unlink()
    rebuild(spoiled)
    assert (spoiled / "README.md").read_bytes() == (mixed / "README.md").read_bytes()


def test_rebuild_corrects_a_stale_table_and_keeps_the_data_card(mixed: Path, spoiled: Path) -> None:
    table = pq.read_table(spoiled / "throws.parquet")
    values = table["landing_x_m"].to_pylist()
    index = table.schema.get_field_index("landing_x_m")
    stale = table.set_column(index, table.schema.field(index), [[1.0, *values[1:]]])
    pq.write_table(stale, spoiled / "throws.parquet")
    (spoiled / "README.md").write_text("mine")
    assert rebuild(spoiled).written == DERIVED
    assert (spoiled / "throws.parquet").read_bytes() == (mixed / "throws.parquet").read_bytes()
    assert (spoiled / "README.md").read_text() == "mine"


def test_rebuild_without_a_table_keeps_lost_trials_but_not_their_reasons(mixed: Path, spoiled: Path) -> None:
    for name in DERIVED:
        (spoiled / name).unlink()
    assert rebuild(spoiled).lost == (4, 6)
    rows = pq.read_table(spoiled / "throws.parquet").to_pylist()
    assert [row["outcome"] for row in rows] == ["landed", "refused", "landed", "landed", "lost", "landed", "lost"]
    assert rows[4]["reason"] == NO_EPISODE
    assert rows[1]["reason"] == "arm_right_1_joint: too fast"
    assert (spoiled / "metadata.yaml").read_bytes() == (mixed / "metadata.yaml").read_bytes()
    assert verify(spoiled) == []


def test_rebuild_of_a_damaged_recording_is_refused_and_writes_nothing(spoiled: Path) -> None:
    data = bytearray((spoiled / "quick_00001.mcap").read_bytes())
    data[len(data) // 2] ^= 1
    (spoiled / "quick_00001.mcap").write_bytes(data)
    (spoiled / "throws.parquet").unlink()
    with pytest.raises(DatasetError, match=r"quick_00001\.mcap: .*\n  try: throwcollect dataset repair .* OUTPUT"):
        rebuild(spoiled)
    assert not (spoiled / "throws.parquet").exists()


def test_rebuild_refuses_a_configuration_that_differs_from_the_manifest(spoiled: Path) -> None:
    path = spoiled / "config.yaml"
    whole = path.read_text()
    path.write_text(whole.replace("  drag_coefficient: 0.0\n", ""))
    before = {each.name: each.read_bytes() for each in spoiled.iterdir() if each.is_file()}
    with pytest.raises(
        DatasetError, match=r"config\.yaml: is not as it was written: datapackage\.json has another hash"
    ):
        rebuild(spoiled)
    assert {each.name: each.read_bytes() for each in spoiled.iterdir() if each.is_file()} == before
    # Without a manifest, the file may come from an earlier version with fewer keys.
    (spoiled / "datapackage.json").unlink()
    assert rebuild(spoiled).written == DERIVED


def test_rebuild_refuses_a_changed_plan(spoiled: Path) -> None:
    table = pq.read_table(spoiled / "plan.parquet")
    seeds = pa.array(range(7), pa.uint64())
    pq.write_table(table.set_column(2, table.schema.field(2), seeds), spoiled / "plan.parquet")
    with pytest.raises(DatasetError, match=r"plan\.parquet: trial 0: was changed since the plan was made\n  try: "):
        rebuild(spoiled)


def test_rebuild_without_a_plan_advises_repair(spoiled: Path) -> None:
    (spoiled / "plan.parquet").unlink()
    with pytest.raises(DatasetError, match=r"plan\.parquet: is missing\n  try: throwcollect dataset repair .* OUTPUT"):
        rebuild(spoiled)


def test_rebuild_without_a_recording_advises_repair(spoiled: Path) -> None:
    (spoiled / "quick_00001.mcap").unlink()
    with pytest.raises(DatasetError, match=r"quick_00001\.mcap is missing\n  try: throwcollect dataset repair"):
        rebuild(spoiled)


def test_rebuild_refuses_recordings_whose_names_are_swapped(dataset: Path) -> None:
    first, second = dataset / "quick_00000.mcap", dataset / "quick_00001.mcap"
    one, other = first.read_bytes(), second.read_bytes()
    first.write_bytes(other)
    second.write_bytes(one)
    with pytest.raises(DatasetError, match=r"quick_00000\.mcap: trial 3: its episode does not belong in this file"):
        rebuild(dataset)


def test_rebuild_of_an_unfinished_dataset_advises_resume(spoiled: Path) -> None:
    (spoiled / "quick_00002.mcap.part").write_bytes(b"")
    with pytest.raises(DatasetError, match=r"not collected to its end\n  try: throwcollect resume"):
        rebuild(spoiled)


def test_rebuild_of_a_directory_without_a_dataset_says_so(mixed: Path, tmp_path: Path) -> None:
    (tmp_path / "notes.txt").write_text("none of it")
    for place in (tmp_path, tmp_path / "gone"):
        with pytest.raises(DatasetError, match=r": holds no dataset$"):
            rebuild(place)
    with pytest.raises(DatasetError, match=r"throws\.parquet: holds no dataset\n  try: .*mixed"):
        rebuild(mixed / "throws.parquet")
