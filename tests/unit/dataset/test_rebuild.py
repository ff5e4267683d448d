"""The files that follow from others come back byte for byte."""

from __future__ import annotations

import shutil
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from throwcollect.dataset.rebuild import NO_EPISODE, rebuild
from throwcollect.dataset.verify import verify
from throwcollect.errors import DatasetError

DERIVED = ("throws.parquet", "datapackage.json", "metadata.yaml")


@pytest.fixture(scope="module")
def mixed(make_module_collection: Any, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A dataset with a refused and two lost trials, one of them alone in its file."""
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


def test_derived_files_come_back_byte_for_byte(mixed: Path, spoiled: Path) -> None:
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


def test_the_data_card_comes_back_with_what_is_known_of_the_collection(mixed: Path, spoiled: Path) -> None:
    (spoiled / "README.md").unlink()
    rebuild(spoiled)
    assert (spoiled / "README.md").read_bytes() == (mixed / "README.md").read_bytes()


def test_a_stale_table_is_made_right_and_the_data_card_stays(mixed: Path, spoiled: Path) -> None:
    table = pq.read_table(spoiled / "throws.parquet")
    values = table["landing_x_m"].to_pylist()
    index = table.schema.get_field_index("landing_x_m")
    stale = table.set_column(index, table.schema.field(index), [[1.0, *values[1:]]])
    pq.write_table(stale, spoiled / "throws.parquet")
    (spoiled / "README.md").write_text("mine")
    assert rebuild(spoiled).written == DERIVED
    assert (spoiled / "throws.parquet").read_bytes() == (mixed / "throws.parquet").read_bytes()
    assert (spoiled / "README.md").read_text() == "mine"


def test_without_any_table_lost_trials_are_lost_without_their_reasons(mixed: Path, spoiled: Path) -> None:
    for name in DERIVED:
        (spoiled / name).unlink()
    assert rebuild(spoiled).lost == (4, 6)
    rows = pq.read_table(spoiled / "throws.parquet").to_pylist()
    assert [row["outcome"] for row in rows] == ["landed", "refused", "landed", "landed", "lost", "landed", "lost"]
    assert rows[4]["reason"] == NO_EPISODE
    assert rows[1]["reason"] == "arm_right_1_joint: too fast"
    assert (spoiled / "metadata.yaml").read_bytes() == (mixed / "metadata.yaml").read_bytes()
    assert verify(spoiled) == []


def test_a_damaged_recording_is_refused_and_nothing_is_written(spoiled: Path) -> None:
    data = bytearray((spoiled / "quick_00001.mcap").read_bytes())
    data[len(data) // 2] ^= 1
    (spoiled / "quick_00001.mcap").write_bytes(data)
    (spoiled / "throws.parquet").unlink()
    with pytest.raises(DatasetError, match=r"quick_00001\.mcap: .*\n  try: throwcollect dataset repair .* OUTPUT"):
        rebuild(spoiled)
    assert not (spoiled / "throws.parquet").exists()


def test_a_configuration_that_lost_a_line_is_refused_though_it_says_the_same(spoiled: Path) -> None:
    path = spoiled / "config.yaml"
    whole = path.read_text()
    path.write_text(whole.replace("  drag_coefficient: 0.0\n", ""))
    before = {each.name: each.read_bytes() for each in spoiled.iterdir() if each.is_file()}
    with pytest.raises(
        DatasetError, match=r"config\.yaml: is not as it was written: datapackage\.json has another hash"
    ):
        rebuild(spoiled)
    assert {each.name: each.read_bytes() for each in spoiled.iterdir() if each.is_file()} == before
    # Without a manifest, it may be the file of an earlier version, which had fewer keys.
    (spoiled / "datapackage.json").unlink()
    assert rebuild(spoiled).written == DERIVED


def test_a_plan_that_was_changed_is_refused(spoiled: Path) -> None:
    table = pq.read_table(spoiled / "plan.parquet")
    seeds = pa.array(range(7), pa.uint64())
    pq.write_table(table.set_column(2, table.schema.field(2), seeds), spoiled / "plan.parquet")
    with pytest.raises(DatasetError, match=r"plan\.parquet: trial 0: was changed since the plan was made\n  try: "):
        rebuild(spoiled)


def test_a_plan_that_cannot_be_read_is_refused_with_a_way_out(spoiled: Path) -> None:
    (spoiled / "plan.parquet").unlink()
    with pytest.raises(DatasetError, match=r"plan\.parquet: is missing\n  try: throwcollect dataset repair .* OUTPUT"):
        rebuild(spoiled)


def test_a_missing_recording_is_refused(spoiled: Path) -> None:
    (spoiled / "quick_00001.mcap").unlink()
    with pytest.raises(DatasetError, match=r"quick_00001\.mcap is missing\n  try: throwcollect dataset repair"):
        rebuild(spoiled)


def test_recordings_under_each_others_names_are_refused(dataset: Path) -> None:
    first, second = dataset / "quick_00000.mcap", dataset / "quick_00001.mcap"
    one, other = first.read_bytes(), second.read_bytes()
    first.write_bytes(other)
    second.write_bytes(one)
    with pytest.raises(DatasetError, match=r"quick_00000\.mcap: trial 3: its episode does not belong in this file"):
        rebuild(dataset)


def test_an_unfinished_collection_is_refused(spoiled: Path) -> None:
    (spoiled / "quick_00002.mcap.part").write_bytes(b"")
    with pytest.raises(DatasetError, match=r"not collected to its end\n  try: throwcollect resume"):
        rebuild(spoiled)


def test_a_directory_of_something_else_is_named_as_such(mixed: Path, tmp_path: Path) -> None:
    (tmp_path / "notes.txt").write_text("none of it")
    for place in (tmp_path, tmp_path / "gone"):
        with pytest.raises(DatasetError, match=r": holds no dataset$"):
            rebuild(place)
    with pytest.raises(DatasetError, match=r"throws\.parquet: holds no dataset\n  try: .*mixed"):
        rebuild(mixed / "throws.parquet")
