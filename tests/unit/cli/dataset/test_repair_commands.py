import json
import signal
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from tests.unit.dataset.conftest import Collection
from tests.unit.dataset.damage import flip

from throwcollect.cli.dataset import repair_commands
from throwcollect.cli.main import main
from throwcollect.episode.record import EpisodeHeader, Samples

Run = Callable[..., int]


@pytest.fixture
def source(tmp_path: Path) -> Path:
    return Collection({"trials": 3}).collect(tmp_path / "source")


@pytest.fixture
def run(monkeypatch: pytest.MonkeyPatch) -> Run:
    """Runs the command line; returns its exit code."""

    def run(*arguments: str | Path) -> int:
        monkeypatch.setattr(sys, "argv", ["throwcollect", *map(str, arguments)])
        # `main` sets handlers of signals, which would stay for the tests that follow.
        monkeypatch.setattr(signal, "signal", lambda *_: None)
        with pytest.raises(SystemExit) as ended:
            main()
        return int(ended.value.code or 0)

    return run


def test_verify_lists_the_findings_and_ends_with_4(run: Run, source: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run("dataset", "verify", source) == 0
    first, second = capsys.readouterr().out.splitlines()
    assert first == f"{source}: nothing wrong"
    assert f"throwcollect dataset verify {source} --replay 100" in second
    (source / "README.md").unlink()
    (source / "plan.parquet").write_bytes(b"")
    assert run("dataset", "verify", source) == 4
    told = capsys.readouterr()
    assert told.out.startswith("plan.parquet: has 0 bytes, in datapackage.json ")
    assert "\nplan.parquet: is damaged: " in told.out
    assert told.out.endswith("README.md: is missing\n")
    assert f"{source}: 3 findings" in told.err


def test_rebuild_says_what_it_wrote(run: Run, source: Path, capsys: pytest.CaptureFixture[str]) -> None:
    before = (source / "throws.parquet").read_bytes()
    (source / "throws.parquet").unlink()
    assert run("dataset", "rebuild", source) == 0
    assert (
        capsys.readouterr().out
        == f"{source}: 3 trials, 3 episodes; wrote throws.parquet, datapackage.json, metadata.yaml\n"
    )
    assert (source / "throws.parquet").read_bytes() == before
    assert run("dataset", "rebuild", source, "--json") == 0
    found = json.loads(capsys.readouterr().out)
    assert found == {
        "trials": 3,
        "episodes": 3,
        "lost": [],
        "rejudged": [],
        "written": ["throws.parquet", "datapackage.json", "metadata.yaml"],
    }


def test_rebuild_lists_throws_that_are_judged_differently_than_before(
    run: Run, source: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """The table has wrong outcomes, as in a dataset that is older than one of the outcomes."""
    table = pq.read_table(source / "throws.parquet")
    card, metadata = (source / "README.md").read_text(), (source / "metadata.yaml").read_bytes()

    def misjudge(trials: int) -> None:
        column = table.schema.get_field_index("outcome")
        outcomes = pa.array(["dropped"] * trials + ["landed"] * (3 - trials))
        pq.write_table(table.set_column(column, table.schema.field(column), outcomes), source / "throws.parquet")
        (source / "README.md").write_text(card.replace("| landed | 3 |", "| dropped | 2 |\n| landed | 1 |") + "mine\n")

    misjudge(2)
    assert run("dataset", "verify", source) == 4
    assert "trial 1: throws.parquet has outcome = 'dropped', the episode gives 'landed'; to judge it again: " in (
        capsys.readouterr().out
    )
    assert run("dataset", "rebuild", source) == 0
    assert capsys.readouterr().out == (
        f"{source}: 3 trials, 3 episodes; wrote throws.parquet, datapackage.json, metadata.yaml, README.md\n"
        "2 throws are judged differently: trial 0: dropped -> landed, trial 1: dropped -> landed\n"
    )
    assert (source / "README.md").read_text() == card + "mine\n"
    assert (source / "metadata.yaml").read_bytes() == metadata
    assert run("dataset", "verify", source) == 0
    misjudge(1)
    capsys.readouterr()
    assert run("dataset", "rebuild", source, "--json") == 0
    found = json.loads(capsys.readouterr().out)
    assert found["rejudged"] == [{"trial": 0, "before": "dropped", "after": "landed"}]


def test_rebuild_of_a_damaged_dataset_hints_at_repair(
    run: Run, source: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    flip(source / "quick_00000.mcap", 20_000)
    assert run("dataset", "rebuild", source) == 4
    assert f"try: throwcollect dataset repair {source} OUTPUT" in capsys.readouterr().err


def test_repair_without_losses_ends_with_0(
    run: Run, source: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (source / "plan.parquet").unlink()
    output = tmp_path / "output"
    assert run("dataset", "repair", source, output) == 0
    assert capsys.readouterr().out == (
        f"plan.parquet: is missing; made again from throws.parquet\n{output}: 3 episodes of 3 trials\n"
    )


def test_repair_lists_what_is_lost_and_ends_with_5(
    run: Run, source: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    flip(source / "quick_00000.mcap", 20_000)
    output = tmp_path / "output"
    assert run("dataset", "repair", source, output) == 5
    told = capsys.readouterr()
    assert told.out == f"trial 0: lost: no whole episode of it was left\n{output}: 2 episodes of 3 trials\n"
    assert f"{output}: 1 trial is lost" in told.err
    assert f"try: throwcollect resume {output}" in told.err
    assert run("dataset", "repair", source, tmp_path / "again", "--json") == 5
    found = json.loads(capsys.readouterr().out)
    assert found["lost"] == [{"trial": 0, "reason": "no whole episode of it was left"}]
    assert (found["trials"], found["episodes"], found["differing"], found["remarks"]) == (3, 2, [], [])
    assert run("dataset", "verify", output) == 0


def test_repair_names_the_first_of_many_lost_trials_and_counts_the_others(
    run: Run, source: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(repair_commands, "_MOST_NAMED", 1)
    (source / "quick_00000.mcap").unlink()
    output = tmp_path / "output"
    assert run("dataset", "repair", source, output) == 5
    lost, rest, result = capsys.readouterr().out.splitlines()
    assert lost == "trial 0: lost: no whole episode of it was left"
    assert (rest, result) == ("2 more trials lost, which --json lists", f"{output}: 0 episodes of 3 trials")


def test_repair_ends_with_5_if_a_kept_episode_differs_from_the_table(
    run: Run, source: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    def scale_efforts(samples: Samples, header: EpisodeHeader) -> tuple[Samples, EpisodeHeader]:
        return replace(samples, effort=samples.effort * 1.01), header

    other = Collection({"trials": 3}).collect(tmp_path / "other", change=scale_efforts)
    (source / "quick_00000.mcap").write_bytes((other / "quick_00000.mcap").read_bytes())
    output = tmp_path / "output"
    assert run("dataset", "repair", source, output) == 5
    told = capsys.readouterr()
    assert told.out.count("as in throws.parquet; kept, as it passes all other checks") == 3
    assert f"{output}: 3 episodes kept that differ from throws.parquet, such as that of trial 0" in told.err
    assert f"try: throwcollect dataset replay {output} --trial 0" in told.err
