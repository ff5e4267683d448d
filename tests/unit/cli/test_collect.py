"""Options of `up` and `resume` that exclude each other, or that the dataset has no use for."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from throwcollect.cli.collect import resume, up
from throwcollect.errors import ConfigError


@pytest.mark.parametrize(
    ("option", "given"),
    [
        ("CONFIG", {"config": Path("throws.yaml")}),
        ("--resume", {"resume": Path("data")}),
        ("--token-file", {"token_file": Path("token")}),
        ("--detach", {"detach": True}),
        ("--view", {"view": True}),
    ],
)
def test_up_refuses_options_that_a_slice_does_not_use(option: str, given: dict[str, Any], tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match=f"^{option}: should be left out with --slice"):
        up(slice="0/2", output=tmp_path / "data", **given)


@pytest.fixture
def submitted(monkeypatch: pytest.MonkeyPatch) -> None:
    """Every dataset was submitted to a cluster, and nothing is left to submit."""
    # In this order: `submit` copies `is_submitted` when it is imported, and would keep the patched one.
    monkeypatch.setattr("throwcollect.cluster.submit.submit_missing", lambda *_, **__: None)
    monkeypatch.setattr("throwcollect.cluster.submission.is_submitted", lambda _: True)


@pytest.mark.usefixtures("submitted")
@pytest.mark.parametrize(
    ("options", "name"),
    [({"simulate": False}, "--no-simulate"), ({"simulations": "4"}, "-n"), ({"runtime": "docker"}, "--runtime")],
)
def test_resume_of_a_submitted_dataset_refuses_options_that_array_tasks_do_not_use(
    options: dict[str, Any], name: str, tmp_path: Path
) -> None:
    with pytest.raises(ConfigError, match=f"^{name}: should be left out"):
        resume(tmp_path, **options)


@pytest.mark.usefixtures("submitted")
def test_resume_of_a_submitted_dataset_prints_the_jobs_as_json(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    resume(tmp_path, json=True)
    assert json.loads(capsys.readouterr().out) == {"directory": str(tmp_path), "array": "", "join": ""}
