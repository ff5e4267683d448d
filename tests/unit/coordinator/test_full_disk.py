"""A plan that is too large for its disk gives one message and leaves no files."""

from __future__ import annotations

import subprocess
from collections.abc import Iterator
from pathlib import Path

import pytest

from throwcollect.config.schema import Config
from throwcollect.coordinator.prepare import prepare
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


def test_a_plan_that_fills_the_disk_leaves_nothing_behind(disk: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("throwcollect.coordinator.prepare.feasibility_check", lambda _: refuse_nothing)
    with pytest.raises(
        ConfigError, match=r"plan\.parquet: cannot be written: No space left on device\n  try: free space on that disk"
    ):
        prepare(config(5_000), disk / "data", sweep_directory=disk)
    assert list(disk.iterdir()) == []
    assert len(prepare(config(50), disk / "data", sweep_directory=disk).trials) == 50
