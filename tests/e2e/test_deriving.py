"""A derived dataset equals a collection of its trials, and the commands of docs/dataset.md work."""

import shlex
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner

from tests.e2e.collection import collect_here
from tests.pages import find_blocks, read_section
from throwcollect.cli.main import assemble
from throwcollect.dataset.verify import verify

pytestmark = pytest.mark.e2e
PAGE = read_section("dataset.md", "Merge, filter, sample, split")

MONDAY = """\
name: monday
trials: 6
seed: 7
ball: {mass_kg: 0.045, drag_coefficient: 0.4}
sim: {engine: ballistic, physics_hz: 250}
sweep:
  parameters:
    task.end.arm_right_4_joint: {min: -0.7, max: -0.2}
    task.duration_s: {min: 0.9, max: 1.2}
record:
  rate_hz: 50
  topics: [joint_states, ball/odometry, controller_state, tf, clock]
  trials_per_shard: 4
run: {replay: 0}
"""
TUESDAY = """\
name: tuesday
trials: 4
seed: 8
ball: {mass_kg: 0.03, drag_coefficient: 0.4}
sim: {engine: ballistic, physics_hz: 250}
sweep:
  sampler: uniform
  parameters:
    task.duration_s: {min: 0.9, max: 1.2}
    task.trajectory.gamma: {min: 1.0, max: 1.2}
record:
  rate_hz: 50
  topics: [joint_states, ball/odometry, controller_state, tf, clock]
  zstd_level: 3
run: {replay: 0}
"""


@pytest.fixture(scope="module")
def home(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A directory with the datasets that the page speaks of, and all that its commands make of them."""
    directory = tmp_path_factory.mktemp("home")
    for text in (MONDAY, TUESDAY):
        name = text.split()[1]
        config = directory / f"{name}.yaml"
        config.write_text(text)
        collect_here(config, directory / "datasets" / name)
    for block in find_blocks("sh", PAGE):
        for line in block.replace("\\\n", " ").splitlines():
            program, command, *arguments = shlex.split(line)
            assert program == "throwcollect"
            if command == "up":
                config, *_, output = arguments
                # The first two datasets of the page are those made above, which differ more from each other.
                if not (directory / output).exists():
                    collect_here(directory / config, directory / output)
            else:
                with pytest.MonkeyPatch.context() as patch:
                    patch.chdir(directory)
                    done = CliRunner().invoke(assemble(), [command, *arguments])
                assert done.exit_code == 0, done.output
    return directory / "datasets"


def test_verify_finds_nothing_wrong_in_derived_datasets(home: Path) -> None:
    derived = [path.parent for path in home.rglob("sources.parquet")]
    assert {str(path.relative_to(home)) for path in derived} == {
        *("both", "short", "few"),
        *("parts/train", "parts/test"),
    }
    for directory in derived:
        assert verify(directory) == []


def test_the_python_program_of_the_page_runs(home: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (python,) = find_blocks("python", PAGE)
    monkeypatch.chdir(home.parent)
    names: dict[str, Any] = {}
    exec(python, names)  # noqa: S102
    assert names["elbow"].std > 0.1
