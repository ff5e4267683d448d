"""Plans that grow while they are collected: the dataset is a pure function of the YAML file all the same."""

import json
import re
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest

from tests.e2e.collection import INPROCESS, call, call_here, fingerprints, interrupt, start
from throwcollect.config.loader import load
from throwcollect.dataset.verify import verify

pytestmark = pytest.mark.e2e
PAGE = (Path(__file__).parents[2] / "docs" / "targets.md").read_text(encoding="utf-8")
LANDED = 100
TRIALS = 192
"""Trials of three rounds: so many landings take the first two, and the third begins before these have ended."""


@pytest.fixture(scope="module")
def config(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The configuration on the page, with fewer throws in coarser steps."""
    (yaml,) = re.findall(r"```yaml\n(.*?)```", PAGE, flags=re.DOTALL)
    assert "until: {landed: 500}" in yaml
    path = tmp_path_factory.mktemp("config") / "targets.yaml"
    coarse = f"sim: {{physics_hz: 250, engine: ballistic}}\nrecord: {{rate_hz: 125}}\n{yaml}"
    path.write_text(coarse.replace("landed: 500", f"landed: {LANDED}"), encoding="utf-8")
    return path


@pytest.fixture(scope="module")
def undisturbed(config: Path, tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, str]:
    """The directory of a collection with one simulation, and its messages."""
    directory = tmp_path_factory.mktemp("undisturbed") / "data"
    done = call_here("up", *INPROCESS, config, "--output", directory)
    assert done.returncode == 0, done.stderr
    return directory, done.stderr


def test_a_collection_ends_with_the_round_that_knows_of_enough_landings(
    undisturbed: tuple[Path, str],
) -> None:
    directory, said = undisturbed
    outcomes = pq.read_table(directory / "throws.parquet")["outcome"].to_pylist()
    assert len(outcomes) == TRIALS
    assert outcomes[:64].count("landed") < LANDED <= outcomes[:128].count("landed")
    assert verify(directory) == []
    follow = f"; more follow from their results, until {LANDED} have landed, at most {10 * LANDED} in all; dataset: "
    assert re.search(rf"^plan: 128 trials.*{re.escape(follow)}", said, re.MULTILINE)
    assert re.search(rf"^\d+ throws: \d+/{LANDED} landed, \d+ failed, 1 simulation, ", said, re.MULTILINE)
    card = (directory / "README.md").read_text(encoding="utf-8")
    assert "spread landings over `distance_m` from 0.8 to 2 in 12 bins, `hit_angle_rad`" in card
    assert f"Collected until {LANDED} throws had landed, or all trials had been used up." in card


def test_the_first_two_rounds_are_sobol_and_the_third_differs(config: Path, undisturbed: tuple[Path, str]) -> None:
    ordinary = ["--set", "sweep.target=null", "--set", "until=null", "--trials", str(TRIALS), "--json"]
    sobol = np.array(
        [list(trial["values"].values()) for trial in json.loads(call_here("plan", config, *ordinary).stdout)]
    )
    plan = pq.read_table(undisturbed[0] / "plan.parquet")
    ours = np.column_stack([plan[key].to_numpy() for key in load(config).sweep.parameters])
    assert (ours[:128] == sobol[:128]).all()
    assert (ours[128:] != sobol[128:]).all()


def test_a_growing_plan_resumed_with_more_simulations_gives_the_same_files(
    config: Path, undisturbed: tuple[Path, str], tmp_path: Path
) -> None:
    directory = tmp_path / "data"
    running = start(config, directory, 1)
    running.wait_until(lambda: running.count_bytes() > 0 and (directory / "plan.rounds.part").exists())
    interrupt(running)
    assert running.finish()[0] == 130
    assert not (directory / "metadata.yaml").exists()
    resumed = call("resume", directory, "-n", "2")
    assert resumed.returncode == 0, resumed.stderr
    assert fingerprints(directory) == fingerprints(undisturbed[0])
