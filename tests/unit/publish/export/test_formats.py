"""What holds for every format: cards, rates, refused outputs, and messages."""

from __future__ import annotations

import re
import shutil
from collections.abc import Iterator
from pathlib import Path

import pyarrow.parquet as pq
import pytest
from tests.unit.publish.export.conftest import FORMATS, MOVING, Export
from typer.testing import CliRunner

from throwcollect import members
from throwcollect.cli.main import assemble
from throwcollect.collect.coordinator.prepare import prepare as prepare_plan
from throwcollect.collect.coordinator.resume import prepare_or_resume
from throwcollect.collect.runs.preparation import prepare, resume
from throwcollect.config.loader import load
from throwcollect.dataset.derive.derivation import sample
from throwcollect.dataset.inspect import info
from throwcollect.dataset.reader import Dataset
from throwcollect.errors import ConfigError, DatasetError, MemberError
from throwcollect.members import load_member
from throwcollect.publish.export.export import export

PLUGINS = Path(__file__).parents[3] / "plugins"


@pytest.mark.parametrize("to", FORMATS)
def test_every_format_has_a_card_with_digest_units_configuration_and_all_files(
    to: str, exported: Export, source: Path
) -> None:
    directory = exported(to)
    card = (directory / "README.md").read_text(encoding="utf-8")
    assert (directory / "config.yaml").read_bytes() == (source / "config.yaml").read_bytes()
    assert info(source).digest in card
    assert "| `landing_x_m` | m | Centre of the ball in world when it crossed the landing plane, x [m]. |" in card
    assert "| `task_end_arm_right_4_joint` | rad |" in card
    assert "| landed | 3 |" in card
    assert "| not_released | 1 |" in card
    assert ", ".join(f"`{joint}`" for joint in MOVING) in card
    listed = re.findall(r"^- `(.+?)`: ", card.partition("## Files")[2].partition("```")[0], re.MULTILINE)
    assert sorted(listed) == sorted(
        f"{path.name}/" if path.is_dir() else path.name for path in directory.iterdir() if path.name != "README.md"
    )


@pytest.mark.parametrize("to", ["parquet", "mat"])
def test_an_export_is_taken_for_no_dataset_and_stays_as_it_is(
    to: str, exported: Export, source: Path, tmp_path: Path
) -> None:
    directory = exported(to)
    before = {path: path.read_bytes() for path in directory.rglob("*") if path.is_file()}
    with pytest.raises(ConfigError, match="holds no dataset"):
        resume(directory)
    with pytest.raises(ConfigError, match="holds no dataset"):
        resume(directory, config=source / "config.yaml")
    for freeze in (prepare_or_resume, lambda config, output: prepare(config, output=output)):
        with pytest.raises(ConfigError, match="expected: a directory that is new or empty") as caught:
            freeze(source / "config.yaml", directory)
        assert caught.value.hint == "choose another one with --output"
    for command in ("info", "verify"):
        done = CliRunner().invoke(assemble(), ["dataset", command, str(directory)])
        assert (done.exit_code, str(done.exception)) == (1, f"{directory}: holds no dataset")
    assert {path: path.read_bytes() for path in directory.rglob("*") if path.is_file()} == before
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("to", ["parquet", "mat"])
def test_the_configuration_in_an_export_of_a_list_gives_the_same_trials(to: str, source: Path, tmp_path: Path) -> None:
    sample(source, tmp_path / "sample", count=3)
    (tmp_path / "sample" / "trials.parquet").unlink()
    export(tmp_path / "sample", tmp_path / "export", to=to)
    plan = prepare_plan(
        load(tmp_path / "export" / "config.yaml"), tmp_path / "again", sweep_directory=tmp_path / "export"
    )
    assert plan.trials.points == Dataset.open(tmp_path / "sample").plan.trials.points
    assert "- `trials.parquet`: " in (tmp_path / "export" / "README.md").read_text(encoding="utf-8")


@pytest.mark.parametrize("to", FORMATS)
def test_an_export_of_a_damaged_dataset_leaves_no_files(to: str, source: Path, tmp_path: Path) -> None:
    broken = Path(shutil.copytree(source, tmp_path / "in" / "dataset"))
    last = sorted(broken.glob("*.mcap"))[-1]
    contents = bytearray(last.read_bytes())
    chunk = pq.read_table(broken / "throws.parquet")["chunk_offset"].drop_null()[-1].as_py()
    contents[chunk + 1000] ^= 0xFF
    last.write_bytes(contents)
    with pytest.raises(DatasetError, match=r"trial \d: chunk: |quick_00001\.mcap"):
        export(broken, tmp_path / "out" / "export", to=to)
    assert list((tmp_path / "out").iterdir()) == []


@pytest.mark.parametrize("rate_hz", [0, -5, 60, 500])
def test_a_rate_that_does_not_divide_the_recorded_one_is_refused(rate_hz: int, source: Path, tmp_path: Path) -> None:
    with pytest.raises(
        ConfigError, match=f"^rate_hz: {rate_hz} samples per second of .*\n  expected: a divisor of 250"
    ):
        export(source, tmp_path / "out", to="npz", rate_hz=rate_hz)
    assert list(tmp_path.iterdir()) == []


@pytest.fixture
def with_csv(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """The package of `tests/plugins/csv_export` is installed."""
    for cached in (members._find_members, load_member):
        cached.cache_clear()
    monkeypatch.syspath_prepend(PLUGINS)
    yield
    monkeypatch.undo()
    members._find_members.cache_clear()


@pytest.mark.usefixtures("with_csv")
def test_an_export_can_use_a_format_of_another_package(source: Path, tmp_path: Path) -> None:
    done = CliRunner().invoke(assemble(), ["dataset", "export", str(source), str(tmp_path / "text"), "--to", "csv"])
    assert done.exit_code == 0, done.stderr
    assert "4 throws of 6 trials" in done.stdout
    assert len((tmp_path / "text" / "throws.csv").read_text().splitlines()) == 1 + 6
    assert len(list((tmp_path / "text").glob("trial_*.csv"))) == 4
    assert 'pd.read_csv("throws.csv")' in (tmp_path / "text" / "README.md").read_text()
    with pytest.raises(ConfigError, match="known: parquet, npz, lerobot, hdf5, mat and csv"):
        export(source, tmp_path / "other", to="zarr")


@pytest.mark.usefixtures("with_csv")
@pytest.mark.parametrize("function", ["write_csv", "tabulate_signals"])
def test_an_error_in_a_format_of_another_package_names_the_package(
    function: str, source: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail(*_: object, **__: object) -> None:
        raise ValueError("no such column")

    monkeypatch.setattr(f"csv_export.csv_files.{function}", fail)
    output = tmp_path / "text"
    done = CliRunner().invoke(assemble(), ["dataset", "export", str(source), str(output), "--to", "csv"])
    assert isinstance(done.exception, MemberError)
    assert done.exception.message == (
        f"the exporter csv of csv_export 1.0 cannot write {output}: ValueError: no such column"
    )
    assert not output.exists()
