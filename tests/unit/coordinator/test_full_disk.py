"""A plan that is too large for its disk gives one message and leaves no files."""

from __future__ import annotations

import subprocess
from collections.abc import Iterator
from pathlib import Path

import pytest

from throwcollect.config.schema import Config
from throwcollect.coordinator.prepare import prepare
from throwcollect.coordinator.resume import resume
from throwcollect.errors import ConfigError

DISK = "256k"


def config(trials: int) -> Config:
    sweep = {"parameters": {"task.duration_s": {"min": 0.9, "max": 1.2}, "ball.mass_kg": {"min": 0.03, "max": 0.06}}}
    return Config.model_validate({"trials": trials, "sweep": sweep})


@pytest.fixture
def disk(tmp_path: Path) -> Iterator[Path]:
    """A small disk."""
    place = tmp_path / "disk"
    place.mkdir()
    mounted = subprocess.run(
        ["mount", "-t", "tmpfs", "-o", f"size={DISK}", "none", place], check=False, capture_output=True
    )
    if mounted.returncode:
        pytest.skip(f"no disk can be mounted here: {mounted.stderr.decode().strip()}")
    yield place
    subprocess.run(["umount", place], check=True)


def refuse_nothing(_: Config) -> None:
    return None


def test_a_plan_too_large_for_the_disk_is_refused_before_a_trial_is_drawn(
    disk: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delattr("throwcollect.coordinator.prepare.draw_points")
    with pytest.raises(
        ConfigError, match=r"a plan of 10000 trials takes 400 kB or more, and 262 kB are free\n  try: free"
    ):
        prepare(config(10_000), disk / "below" / "data", sweep_directory=disk)
    assert list(disk.iterdir()) == []


def test_a_plan_that_fills_the_disk_leaves_nothing_behind(disk: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("throwcollect.coordinator.prepare.feasibility_check", lambda _: refuse_nothing)
    with pytest.raises(
        ConfigError, match=r"plan\.parquet: cannot be written: No space left on device\n  try: free space on that disk"
    ):
        prepare(config(5_000), disk / "data", sweep_directory=disk)
    assert list(disk.iterdir()) == []
    assert len(prepare(config(50), disk / "data", sweep_directory=disk).trials) == 50


def test_resuming_with_more_trials_than_the_disk_holds_changes_nothing(
    disk: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("throwcollect.coordinator.prepare.feasibility_check", lambda _: refuse_nothing)
    prepare(config(50), disk / "data", sweep_directory=disk)
    before = {path: path.read_bytes() for path in (disk / "data").iterdir() if path.is_file()}
    monkeypatch.delattr("throwcollect.coordinator.prepare.draw_points")
    with pytest.raises(
        ConfigError, match=r"a plan of 10000 trials takes 400 kB or more, and \d+ kB are free\n  try: free"
    ):
        resume(config(10_000), disk / "data", sweep_directory=disk)
    assert {path: path.read_bytes() for path in (disk / "data").iterdir() if path.is_file()} == before
