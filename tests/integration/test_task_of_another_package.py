"""A task without a throw, in a package of its own (`tests/plugins/reach`), works from plan to report."""

import json
import shutil
from collections.abc import Callable, Iterator
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
from typing import Any

import pytest

from tests.e2e.collection import call_here
from tests.e2e.plugins import process_with_plugins, run_program

Command = Callable[..., str]

REACH = """\
name: reach
task: {name: reach}
sim: {engine: ballistic, physics_hz: 100, max_trial_s: 1.6}
until: {reached: 30}
trials: 200
sweep: {parameters: {task.duration_s: {min: 0.8, max: 2.4}}}
record: {rate_hz: 50}
"""
READ = """\
import throwcollect
dataset = throwcollect.load(directory)
trial = dataset.select("outcome == 'missed'")[0]
found = {
    "columns": dataset.throws.column_names,
    "description": dataset.throws.schema.field("outcome").metadata[b"description"].decode(),
    "landing": trial.events.landing,
    "reason": trial.reason,
    "end_rad": float(trial.joints.position[-1, trial.joints.names.index("torso_1_joint")]),
    "end_error_rad": trial.row["torso_1_joint_end_error_rad"],
}
"""

FEW = REACH.replace("until: {reached: 30}\n", "").replace("trials: 200", "trials: 3")
FAIL = """
from reach.reach_task import ReachTask

def fail(*_):
    {does}

found, ReachTask.kept, ReachTask.{method} = {{}}, ReachTask.{method}, fail
"""
MEND = """
from reach.reach_task import ReachTask

found, ReachTask.{method} = {{}}, ReachTask.kept
"""


@pytest.fixture(scope="module")
def process() -> Iterator[ProcessPoolExecutor]:
    with process_with_plugins() as process:
        yield process


@pytest.fixture(scope="module")
def throwcollect(process: ProcessPoolExecutor) -> Command:
    """A function that calls throwcollect with the task installed; the command must succeed; returns its output."""

    def run(*arguments: str | Path) -> str:
        done = process.submit(call_here, *arguments).result()
        assert done.returncode == 0, done.stderr
        return str(done.stdout)

    return run


@pytest.fixture(scope="module")
def reached(throwcollect: Command, tmp_path_factory: pytest.TempPathFactory) -> Path:
    directory = tmp_path_factory.mktemp("reach")
    (directory / "reach.yaml").write_text(REACH)
    throwcollect("up", directory / "reach.yaml", "--runtime", "inprocess", "--output", directory / "data")
    return directory / "data"


@pytest.fixture(scope="module")
def few(throwcollect: Command, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A configuration of few trials, beside the dataset that was collected of it while the task still worked."""
    directory = tmp_path_factory.mktemp("few")
    (directory / "reach.yaml").write_text(FEW)
    throwcollect("up", directory / "reach.yaml", "--runtime", "inprocess", "--output", directory / "data")
    return directory


def test_until_counts_the_success_outcome_of_the_task(throwcollect: Command, reached: Path) -> None:
    info: dict[str, Any] = json.loads(throwcollect("dataset", "info", reached, "--json"))
    assert info["trials"] == 41  # of 200 possible ones: the last one is the thirtieth success
    assert info["outcomes"]["reached"] == info["wanted"] == 30
    assert set(info["outcomes"]) == {"reached", "missed"}
    assert (info["success"], info["noun"], info["landing"]) == ("reached", "trial", None)
    assert "landing" not in throwcollect("dataset", "info", reached)


def test_the_table_has_the_measures_of_the_task(process: ProcessPoolExecutor, reached: Path) -> None:
    found = process.submit(run_program, READ, directory=reached).result()
    own = found["columns"].index("torso_1_joint_end_error_rad")
    assert own < found["columns"].index("position_peak_share")
    assert not [column for column in found["columns"] if column.startswith(("release", "landing"))]
    assert found["description"] == "reached, missed, limit_violated, tracking_failed, lost or refused."
    assert found["landing"] is None
    assert found["end_error_rad"] == pytest.approx(0.2 - found["end_rad"])
    assert found["reason"] == f"torso_1_joint ended {found['end_error_rad']:.3g} rad away from its end"


def test_a_dataset_of_the_task_can_be_verified_mended_and_replayed(throwcollect: Command, reached: Path) -> None:
    assert "nothing wrong" in throwcollect("dataset", "verify", reached)
    table = (reached / "throws.parquet").read_bytes()
    (reached / "throws.parquet").unlink()
    throwcollect("resume", reached, "--no-simulate")
    assert (reached / "throws.parquet").read_bytes() == table
    throwcollect("dataset", "replay", reached, "--trial", "3")


def test_a_dataset_of_the_task_can_be_filtered_by_its_measures(
    throwcollect: Command, reached: Path, tmp_path: Path
) -> None:
    throwcollect("dataset", "filter", reached, tmp_path / "some", "--where", "torso_1_joint_end_error_rad > 0.01")
    info = json.loads(throwcollect("dataset", "info", tmp_path / "some", "--json"))
    assert list(info["outcomes"]) == ["missed"]


def test_a_dataset_of_the_task_can_be_exported_and_reported(
    throwcollect: Command, reached: Path, tmp_path: Path
) -> None:
    throwcollect("dataset", "export", reached, tmp_path / "parquet", "--to", "parquet")
    assert "simulated trials of the task reach" in (tmp_path / "parquet" / "README.md").read_text()
    throwcollect("dataset", "report", reached, "--output", tmp_path / "report.html")
    page = (tmp_path / "report.html").read_text()
    assert "41 simulated trials of the task reach by Talos" in page
    assert "How trials end, and where failures lie" in page
    assert "Where the balls land" not in page


def test_a_dataset_of_a_task_that_is_not_installed_is_refused_in_one_sentence(reached: Path) -> None:
    done = call_here("dataset", "info", reached)  # in this process, which does not find the package
    assert done.returncode == 2
    line = (reached / "config.yaml").read_text().splitlines().index("  name: reach") + 1
    assert (
        f"{reached / 'config.yaml'}:{line}: task.name: should be 'throw', 'throw_into' or 'slide', got 'reach'"
        in done.stderr
    )


def test_a_configuration_without_a_task_name_is_for_throws(throwcollect: Command, tmp_path: Path) -> None:
    path = tmp_path / "throws.yaml"
    path.write_text("task: {duration_s: 1.1}\nuntil: {landed: 3}\n")
    printed = throwcollect("config", path)
    assert "  name: throw\n" in printed
    assert "until:\n  landed: 3\n" in printed


@pytest.mark.parametrize(
    ("method", "does", "codes", "said"),
    [
        (
            "assess",
            "1 / 0",
            {
                "up {config} --runtime inprocess --output {new}": 3,
                "dataset verify {data}": 1,
                "dataset replay {data} --trial 1": 1,
            },
            "cannot judge trial {trial}: ZeroDivisionError: division by zero",
        ),
        (
            "assess",
            "from dataclasses import replace; return "
            "replace(_[1], end_error_rad=dict.fromkeys(_[0].config.task.end, float('nan'))), None",
            {"up {config} --runtime inprocess --output {new}": 3},
            "cannot judge trial {trial}: ValueError: Out of range float values are not JSON compliant",
        ),
        (
            "__init__",
            "1 / 0",
            {"plan {config}": 1, "dataset verify {data}": 1},
            "cannot be made: ZeroDivisionError: division by zero",
        ),
    ],
)
def test_an_error_in_the_task_gives_one_sentence_that_names_it(
    method: str,
    does: str,
    codes: dict[str, int],
    said: str,
    process: ProcessPoolExecutor,
    throwcollect: Command,
    few: Path,
    tmp_path: Path,
) -> None:
    config, data = few / "reach.yaml", Path(shutil.copytree(few / "data", tmp_path / "data"))
    process.submit(run_program, FAIL.format(method=method, does=does)).result()
    try:
        for number, (command, code) in enumerate(codes.items()):
            words = command.format(config=config, data=data, new=tmp_path / f"new_{number}").split()
            done = process.submit(call_here, *words).result()
            sentence = f"the task reach of reach 1.0 {said.format(trial=1 if 'replay' in words else 0)}"
            assert (done.returncode, sentence in done.stderr) == (code, True), done.stderr
            assert "internal error" not in done.stderr
    finally:
        process.submit(run_program, MEND.format(method=method)).result()
    assert "nothing wrong" in throwcollect("dataset", "verify", data)
