"""Every configuration that comes with the project can be collected."""

import json
from pathlib import Path

import pytest

from tests.e2e.collection import call, collect_here
from throwcollect.dataset.verify import verify

pytestmark = pytest.mark.e2e
CONFIGS = sorted((Path(__file__).parents[2] / "configs").glob("*.yaml"))
WHOLE = {"reference": 2}
"""Configurations that are collected as a whole, as they have few points, with the number of their trials."""


def test_the_project_comes_with_the_known_configurations() -> None:
    assert {path.stem for path in CONFIGS} >= {"dmp", "grid", "quickstart", "randomised", "reference", "targets"}


@pytest.mark.parametrize("config", CONFIGS, ids=lambda path: path.stem)
def test_a_configuration_is_collected_and_verified(config: Path, tmp_path: Path) -> None:
    trials = WHOLE.get(config.stem, 2)
    options = [] if config.stem in WHOLE else ["--trials", str(trials)]
    summary = collect_here(config, tmp_path / "data", "--set", "run.replay=0", *options)
    assert summary["trials"] == trials
    assert summary["episodes"] > 0
    assert verify(tmp_path / "data") == []
    # Another process simulates all of them again; `up` would start one that imports everything anew.
    again = call("dataset", "replay", tmp_path / "data", "--all", "--json")
    assert (again.returncode, again.stderr) == (0, "")
    assert [each["differences"] for each in json.loads(again.stdout)] == [[]] * summary["episodes"]
