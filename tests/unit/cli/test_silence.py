"""With `--json` a command prints one document, and only warnings and errors to standard error."""

from __future__ import annotations

import json
from pathlib import Path
from subprocess import CompletedProcess

import pytest
from tests.e2e.collection import CONFIG, FAST, call_here, write_config
from tests.unit.dataset.conftest import Collection

from throwcollect import progress_log
from throwcollect.cluster import slurm
from throwcollect.coordinator import prepare

SLICED = CONFIG + "record: {{trials_per_shard: 1}}\n"


def call_without_and_with_json(*arguments: str | Path) -> tuple[str, CompletedProcess[str]]:
    """Call a command twice; returns its standard error without `--json`, and all that it prints with it."""
    return call_here(*arguments).stderr, call_here(*arguments, "--json")


def test_plan_with_json_prints_only_the_document_even_for_a_large_plan(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(prepare, "_ANNOUNCED_TRIALS", 1)
    said, printed = call_without_and_with_json("plan", write_config(tmp_path, trials=2, sim=FAST))
    assert "plan: checks 2 trials" in said
    assert printed.stderr == ""
    assert len(json.loads(printed.stdout)) == 2


def test_plan_with_json_still_warns_of_a_robot_below_the_ground(tmp_path: Path) -> None:
    sunken = CONFIG + "robot: {{base_height_m: 0.5}}\n"
    said, printed = call_without_and_with_json("plan", write_config(tmp_path, trials=2, text=sunken, sim=FAST))
    assert "below the ground" in said
    assert printed.stderr in said
    assert "below the ground" in printed.stderr


@pytest.mark.parametrize(
    ("command", "said"),
    [
        ("verify {data}", "1 of 2 recordings checked"),
        ("stats {data}", "1 of 4 episodes read"),
        ("filter {data} {new} --where trial<3", "2 of 3 trials written"),
        ("merge {data} {new}", "3 of 4 trials written"),
        ("export {data} {new} --to npz", "3 of 4 trials exported"),
        ("export {data} {new} --to mat", "1 of 2 motions described"),
        ("report {data} -o {new}.html", "3 of 4 flights compared"),
        ("view {data} {new}", "3 of 4 throws written"),
    ],
)
def test_progress_is_printed_with_large_datasets_but_not_with_json(
    command: str, said: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    source = Collection({"trials": 4, "record": {"trials_per_shard": 2}}).collect(tmp_path / "data")
    monkeypatch.setattr(progress_log, "_EVERY_S", 0.0)

    def call(new: str, *last: str) -> CompletedProcess[str]:
        return call_here("dataset", *command.format(data=source, new=tmp_path / new).split(), *last)

    assert said in call("told").stderr.splitlines()
    printed = call("silent", "--json")
    assert printed.stderr == ""
    json.loads(printed.stdout)


def test_a_dataset_whose_digest_takes_long_tells_its_progress(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    source = Collection({"trials": 2}).collect(tmp_path / "data")
    monkeypatch.setattr(progress_log, "_EVERY_S", 0.0)
    assert call_here("dataset", "digest", source).stderr == "1 of 2 episodes checked\n"


def test_submit_and_resume_with_json_print_only_the_document(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(slurm, "submit", lambda *_: "7")
    monkeypatch.setattr(slurm, "check", lambda _: None)
    monkeypatch.setattr(slurm, "find_largest_array", lambda: None)
    monkeypatch.setattr(slurm, "find_tasks", lambda: {})
    monkeypatch.setattr(slurm, "find_ended", lambda _: {})
    config = write_config(tmp_path, trials=2, text=SLICED, sim=FAST)
    submission = ("submit", config, "--tasks", "2")
    assert "plan: 2 trials" in call_here(*submission, "--output", tmp_path / "told").stderr
    printed = call_here(*submission, "--output", tmp_path / "silent", "--json")
    assert printed.stderr == ""
    assert json.loads(printed.stdout)["array"] == "7"

    said, printed = call_without_and_with_json("resume", tmp_path / "silent")
    assert "submitted" in said
    assert printed.stderr == ""
    assert json.loads(printed.stdout)["array"] == "7"
