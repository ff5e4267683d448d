"""Every configuration that comes with the project can be collected."""

import json
from pathlib import Path

import pytest

from tests.e2e.collection import INPROCESS, call
from throwcollect.dataset.verify import verify

pytestmark = pytest.mark.e2e
CONFIGS = sorted((Path(__file__).parents[2] / "configs").glob("*.yaml"))
WHOLE = {"reference": 2}
"""Trials of those that have as many as their points, and few of them."""


def test_there_are_configurations() -> None:
    assert {path.stem for path in CONFIGS} >= {"dmp", "grid", "quickstart", "randomised", "reference", "targets"}


@pytest.mark.parametrize("config", CONFIGS, ids=lambda path: path.stem)
def test_a_configuration_is_collected_and_verified(config: Path, tmp_path: Path) -> None:
    trials = WHOLE.get(config.stem, 3)
    options = [] if config.stem in WHOLE else ["--trials", str(trials)]
    collected = call("up", *INPROCESS, config, "--output", tmp_path / "data", "--json", *options)
    assert collected.returncode == 0, collected.stderr
    summary = json.loads(collected.stdout)
    assert summary["trials"] == trials
    assert summary["episodes"] > 0
    assert verify(tmp_path / "data") == []
