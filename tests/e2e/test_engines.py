"""A collection on another physics engine than Bullet, as a user has it."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.e2e.collection import call, collect, write_config

pytestmark = pytest.mark.e2e


def test_a_collection_without_contacts_can_be_verified_replayed_and_collected_again(tmp_path: Path) -> None:
    config, directory = write_config(tmp_path, trials=6), tmp_path / "throws"
    # At the end three of the trials are simulated once more, in another process, and compared bit for bit.
    options = ("--set", "sim.engine=ballistic", "--set", "run.replay=3")
    first = collect(config, directory, 2, *options)
    assert first["outcomes"] == {"landed": 6}
    verified = call("dataset", "verify", directory, "--replay", "6")
    assert verified.returncode == 0, verified.stderr
    assert "leaves the tool when the tool would have to pull it" in (directory / "README.md").read_text()
    again = collect(directory / "config.yaml", tmp_path / "again", 1)
    assert again["digest"] == first["digest"]
