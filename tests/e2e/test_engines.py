"""A collection on another physics engine than Bullet, as a user has it."""

from __future__ import annotations

from importlib.metadata import version
from pathlib import Path

import pytest

from tests.e2e.collection import call_here, collect_here, write_config

pytestmark = pytest.mark.e2e


def test_a_collection_of_mujoco_can_be_verified(tmp_path: Path) -> None:
    config, directory = write_config(tmp_path, trials=6), tmp_path / "throws"
    first = collect_here(config, directory, "--set", "sim.engine=mujoco")
    assert first["outcomes"] == {"landed": 6}
    verified = call_here("dataset", "verify", directory, "--replay", "6")
    assert verified.returncode == 0, verified.stderr
    assert "Simulated with MuJoCo: rigid bodies" in (directory / "README.md").read_text()
    assert f"| mujoco-core | {version('mujoco-core')} |" in (directory / "README.md").read_text()
