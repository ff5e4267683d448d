"""Collecting until enough throws have landed: the dataset is a pure function of the YAML file all the same."""

import re
from pathlib import Path

import pyarrow.parquet as pq
import pytest

from tests.e2e.collection import INPROCESS, call, call_here, fingerprints, interrupt, start
from throwcollect.dataset.verify import verify

pytestmark = pytest.mark.e2e
LANDED = 20
YAML = f"""\
name: until
until: {{landed: {LANDED}}}
sweep:
  sampler: uniform
  parameters:
    task.end.arm_right_4_joint: {{min: -0.95, max: -0.15}}
    task.duration_s: {{min: 0.7, max: 1.35}}
sim: {{physics_hz: 250, engine: ballistic}}
record: {{rate_hz: 125}}
run: {{replay: 0}}
"""


@pytest.fixture(scope="module")
def config(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("config") / "until.yaml"
    path.write_text(YAML, encoding="utf-8")
    return path


@pytest.fixture(scope="module")
def undisturbed(config: Path, tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, str]:
    """The directory of a collection with one simulation, and its messages."""
    directory = tmp_path_factory.mktemp("undisturbed") / "data"
    done = call_here("up", *INPROCESS, config, "--output", directory)
    assert done.returncode == 0, done.stderr
    return directory, done.stderr


def test_a_collection_ends_with_the_last_landing_that_was_asked_for(undisturbed: tuple[Path, str]) -> None:
    directory, said = undisturbed
    outcomes = pq.read_table(directory / "throws.parquet")["outcome"].to_pylist()
    assert outcomes.count("landed") == LANDED
    assert outcomes[-1] == "landed"
    assert len(outcomes) > LANDED
    assert verify(directory) == []
    assert re.search(rf"^plan: at most {10 * LANDED} trials, until {LANDED} have landed", said, re.MULTILINE)
    assert re.search(rf"^\d+ throws: {LANDED}/{LANDED} landed, \d+ failed, 1 simulation, ", said, re.MULTILINE)
    card = (directory / "README.md").read_text(encoding="utf-8")
    assert f"Collected in order of trials until {LANDED} throws had landed, or all trials had been used up." in card


def test_it_gives_the_same_files_when_it_is_resumed_with_more_simulations(
    config: Path, undisturbed: tuple[Path, str], tmp_path: Path
) -> None:
    directory = tmp_path / "data"
    running = start(config, directory, 1)
    running.wait_until(lambda: running.count_bytes() > 0)
    interrupt(running)
    assert running.finish()[0] == 130
    assert not (directory / "metadata.yaml").exists()
    resumed = call("resume", directory, "-n", "2")
    assert resumed.returncode == 0, resumed.stderr
    assert fingerprints(directory) == fingerprints(undisturbed[0])
