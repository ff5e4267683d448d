"""With `--json` a command prints one document, and only warnings and errors to standard error."""

from __future__ import annotations

import json
from pathlib import Path
from subprocess import CompletedProcess

import pytest
from tests.e2e.collection import CONFIG, FAST, call_here, write_config

from throwcollect.cluster import slurm

SLICED = CONFIG + "record: {{trials_per_shard: 1}}\n"


def call_without_and_with_json(*arguments: str | Path) -> tuple[str, CompletedProcess[str]]:
    """Call a command twice; returns its standard error without `--json`, and all that it prints with it."""
    return call_here(*arguments).stderr, call_here(*arguments, "--json")


def test_submit_and_resume_with_json_print_only_the_document(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(slurm, "submit", lambda *_: "7")
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
