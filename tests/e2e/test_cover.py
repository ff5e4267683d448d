"""Covering the cells of landings: one dataset after the other, each a fixed plan."""

from pathlib import Path

import pytest

from tests.e2e.collection import INPROCESS, call_here, fingerprints
from tests.pages import find_blocks, read_section
from throwcollect.config.loader import load
from throwcollect.dataset.reader import Dataset
from throwcollect.dataset.verify import verify

pytestmark = pytest.mark.e2e


@pytest.fixture(scope="module")
def config(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The configuration on the page, with fewer throws in coarser steps."""
    (yaml,) = find_blocks("yaml", read_section("learning.md", "Evenly over where throws land"))
    assert "trials: 1920" in yaml
    path = tmp_path_factory.mktemp("config") / "targets.yaml"
    coarse = f"sim: {{physics_hz: 250, engine: ballistic}}\nrecord: {{rate_hz: 125}}\nrun: {{replay: 0}}\n{yaml}"
    path.write_text(coarse.replace("trials: 1920", "trials: 90"), encoding="utf-8")
    return path


def test_rounds_are_datasets_that_can_be_continued_and_merged(config: Path, tmp_path: Path) -> None:
    rounds = tmp_path / "rounds"
    few = call_here("cover", *INPROCESS, config, "--rounds", "3", "--output", rounds)
    assert few.returncode == 0, few.stderr
    found = [rounds / f"round_0{number}" for number in (1, 2, 3)]
    assert [len(Dataset.open(each)) for each in found] == [30, 30, 30]
    assert [verify(each) for each in found] == [[], [], []]
    assert load(found[1] / "config.yaml").sweep.target == load(config).sweep.target
    before = [fingerprints(each) for each in found]
    again = call_here("cover", *INPROCESS, config, "--rounds", "3", "--output", rounds)
    assert again.returncode == 0, again.stderr
    assert [fingerprints(each) for each in found] == before
    alone = call_here("up", *INPROCESS, rounds / "round_02.yaml", "--output", tmp_path / "alone")
    assert alone.returncode == 0, alone.stderr
    assert fingerprints(tmp_path / "alone") == before[1]
    merged = call_here("dataset", "merge", *found, rounds / "all")
    assert merged.returncode == 0, merged.stderr
    assert load(rounds / "all" / "config.yaml").sweep.target == load(config).sweep.target
