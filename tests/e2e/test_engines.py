"""A collection on another physics engine than Bullet, as a user has it."""

from __future__ import annotations

import json
from importlib.metadata import version
from pathlib import Path

import pytest

from tests.e2e.collection import call_here, collect_here, write_config

pytestmark = pytest.mark.e2e


def test_a_collection_of_mujoco_can_be_verified_and_compared_with_bullet(tmp_path: Path) -> None:
    config, directory = write_config(tmp_path, trials=6), tmp_path / "throws"
    first = collect_here(config, directory, "--set", "sim.engine=mujoco")
    assert first["outcomes"] == {"landed": 6}
    verified = call_here("dataset", "verify", directory, "--replay", "6")
    assert verified.returncode == 0, verified.stderr
    assert "Simulated with MuJoCo: rigid bodies" in (directory / "README.md").read_text()
    assert f"| mujoco-core | {version('mujoco-core')} |" in (directory / "README.md").read_text()
    compared = call_here("dataset", "replay", directory, "--all", "--engine", "bullet", "--json")
    assert compared.returncode == 0, compared.stderr
    answer = json.loads(compared.stdout)
    assert [each["again"] for each in answer["throws"]] == ["landed"] * 6
    largest = {each["column"]: each["largest"] for each in answer["columns"]}
    assert 1e-5 < largest["landing_x_m"] < 0.02
    assert largest["arm_right_4_joint_tracking_error_rad"] < 1e-4
    mixed = call_here("dataset", "replay", directory, "--all", "--engine", "mujoco")
    assert mixed.returncode == 2
    assert "by mujoco themselves" in mixed.stderr
