"""Datasets collected by arrays of Slurm: the same bytes as by one `up`, whatever happens to tasks and nodes."""

from __future__ import annotations

import json
import shlex
import shutil
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from tests.cluster.conftest import USER
from tests.cluster.slurm import Slurm
from tests.e2e.collection import CONFIG, FAST, call_here, fingerprints, write_config
from throwcollect import runs
from throwcollect.collect.cluster.submission import read_submission
from throwcollect.state_directory import STATE_VARIABLE

pytestmark = pytest.mark.cluster
SLICED = CONFIG + "record: {{trials_per_shard: {per_shard}}}\n"
TASKS = 3
SLOW = "sim.real_time_factor=1"
"""Makes array tasks of few trials last long, without using the processor or changing the samples."""


def call(slurm: Slurm, *arguments: str | Path, expect: int = 0, **environment: str) -> str:
    """Call throwcollect where Slurm is, in this process; returns what it prints on both streams."""
    with pytest.MonkeyPatch.context() as patch:
        for name, value in {**slurm.environment, **environment}.items():
            patch.setenv(name, value)
        done = call_here(*arguments)
    said = done.stderr + done.stdout
    assert done.returncode == expect, said
    return said


def configure(directory: Path, *, trials: int, shards: int = 2 * TASKS) -> Path:
    text = SLICED.replace("{per_shard}", str(trials // shards))
    return write_config(directory, trials=trials, text=text, sim=FAST)


def collect_whole(config: Path, directory: Path) -> dict[str, str]:
    """Collect a configuration in one run; returns the fingerprints of its files."""
    with runs.prepare(config, overrides=["run.runtime=inprocess"], output=directory) as run:
        run.collect()
    return fingerprints(directory)


def recordings(files: dict[str, str]) -> dict[str, str]:
    """The files that do not depend on the configured speed: the recordings, and the table of outcomes."""
    return {name: each for name, each in files.items() if name.endswith(".mcap") or name == "throws.parquet"}


def submit(slurm: Slurm, config: Path, directory: Path, *settings: str, tasks: int = TASKS) -> str:
    """Submit a dataset; returns the number of the array."""
    options = [word for setting in ("cluster.memory=1G", *settings) for word in ("--set", setting)]
    said = call(slurm, "submit", config, "--output", directory, "--tasks", str(tasks), "--json", *options)
    return str(json.loads(said[said.index("{") :])["array"])


def states(slurm: Slurm, array: str) -> dict[str, tuple[str, str]]:
    """State and node of each task of an array, by its index."""
    lines = slurm.run("squeue", "--noheader", "--array", "--states=all", f"--jobs={array}", "--format=%K|%T|%N")
    return {index: (state, node) for index, state, node in (line.strip().split("|") for line in lines.splitlines())}


def wait_until(condition: Callable[[], bool], *, seconds: float = 60) -> None:
    deadline = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < deadline
        time.sleep(0.2)


@pytest.fixture(scope="module")
def short(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, dict[str, str]]:
    """A configuration of few trials, and the files that it makes."""
    directory = tmp_path_factory.mktemp("short")
    config = configure(directory, trials=24)
    return config, collect_whole(config, directory / "whole")


@pytest.fixture(scope="module", autouse=True)
def limited(slurm: Slurm, tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[Path, dict[str, str]]]:
    """A dataset that is collected beside all other tests, as its time limit is one of minutes; and its files.

    Its first task ends before the limit. The last one has twice the work, and cannot.
    """
    directory = tmp_path_factory.mktemp("limited")
    config = configure(directory, trials=45, shards=3)
    apart = f'cluster.lines=["#SBATCH --nodelist={slurm.nodes[-1]}"]'
    array = submit(slurm, config, directory / "data", apart, "cluster.time=2:00", "sim.real_time_factor=0.5", tasks=2)
    yield directory / "data", recordings(collect_whole(config, directory / "whole"))
    slurm.run("scancel", "--quiet", array)


def test_resume_submits_only_the_missing_slices(
    slurm: Slurm, short: tuple[Path, dict[str, str]], tmp_path: Path
) -> None:
    """A task is cancelled, and then the joining job."""
    config, whole = short
    data = tmp_path / "with blank" / "data"
    array = submit(slurm, config, data, "cluster.at_once=2")
    slurm.run("scancel", f"{array}_2")
    assert "1 slice of 3 not collected: cancelled" in call(slurm, "wait", "--run", data, expect=130)
    assert "0 | slice 0/3: trials 0 to 7" in call(slurm, "logs", "0", "--run", data)
    assert "1 task;" in call(slurm, "resume", data)
    slurm.run("scancel", read_submission(data).jobs[-1].join)
    assert "all slices are finished, but they are not joined" in call(slurm, "wait", "--run", data, expect=3)
    assert "joins the slices; all of them are finished" in call(slurm, "resume", data)
    assert "digest" in call(slurm, "wait", "--run", data)
    assert fingerprints(data) == whole
    assert "nothing is left to submit" in call(slurm, "resume", data)
    said = call(slurm, "resume", data, "--trials", "700", expect=2)
    assert f"trials: the plan in {data} has 24, got 700" in said
    said = call(slurm, "resume", data, "--set", "ball.mass_kg=0.1", expect=2)
    assert f"ball.mass_kg: {data} was begun with 0.045, got 0.1" in said
    said = call(slurm, "up", config, "--resume", data, expect=2)
    assert f"--resume {data}: was submitted, so tasks of a cluster collect it" in said


def test_a_node_that_does_not_see_the_directory_is_named(
    slurm: Slurm, short: tuple[Path, dict[str, str]], tmp_path: Path
) -> None:
    config, whole = short
    data = tmp_path / "share" / "data"
    data.parent.mkdir()
    node = slurm.nodes[0]
    slurm.kill_slurmd(node)
    slurm.revive(node, without=data.parent)
    try:
        wait_until(lambda: slurm.state(node) == "idle")
        submit(slurm, config, data, f'cluster.lines=["#SBATCH --nodelist={node}"]', tasks=2)
        began = time.monotonic()
        said = call(slurm, "wait", "--run", data, expect=3)
        assert f"node {node} does not see {data}" in said
        assert time.monotonic() - began < 30
    finally:
        slurm.kill_slurmd(node)
        slurm.revive(node)
    wait_until(lambda: slurm.state(node) == "idle")
    call(slurm, "resume", data)
    call(slurm, "wait", "--run", data)
    assert fingerprints(data) == whole


def test_a_run_can_be_stopped(slurm: Slurm, tmp_path: Path) -> None:
    config = configure(tmp_path, trials=60)
    data = tmp_path / "data"
    array = submit(slurm, config, data, SLOW)
    wait_until(lambda: any(state == "RUNNING" for state, _ in states(slurm, array).values()))
    assert "not complete" in call(slurm, "stop", "--run", data)
    assert not any(state in ("PENDING", "RUNNING") for state, _ in states(slurm, array).values())
    assert "3 slices of 3 not collected: cancelled" in call(slurm, "wait", "--run", data, expect=130)


def test_no_trial_is_lost_when_nodes_die_and_array_tasks_are_preempted(
    slurm: Slurm, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    # Records of killed array tasks stay behind; here, they do not mix with those of the user.
    monkeypatch.setenv(STATE_VARIABLE, str(tmp_path / "state"))
    config = configure(tmp_path, trials=60)
    whole = recordings(collect_whole(config, tmp_path / "whole"))
    data = tmp_path / "data"
    array = submit(slurm, config, data, "cluster.partition=low", "cluster.cores=2", SLOW)
    wait_until(lambda: [state for state, _ in states(slurm, array).values()] == ["RUNNING"] * TASKS)
    wait_until(lambda: any((data / "slices").glob("*/*.part")))
    dead, silent, wanted = (node for _, node in states(slurm, array).values())
    slurm.kill_node(dead)
    slurm.kill_slurmd(silent)
    urgent = ("--partition=main", f"--nodelist={wanted}", "--cpus-per-task=2", "--output=/dev/null", "--wrap=sleep 5")
    slurm.run("sbatch", *urgent)
    wait_until(lambda: all(slurm.state(node).startswith("down") for node in (dead, silent)), seconds=90)
    slurm.revive(silent)
    slurm.revive(dead)
    call(slurm, "wait", "--run", data)
    assert recordings(fingerprints(data)) == whole


def test_another_user_can_submit_the_printed_script_with_an_image(
    slurm: Slurm, short: tuple[Path, dict[str, str]], shared: Path, sif: Path
) -> None:
    """The user of the jobs has nothing but the image, and the script of somebody else."""
    config, whole = short
    data = shared / "data"
    shutil.copy(config, shared / "throws.yaml")
    arguments = ("submit", shared / "throws.yaml", "--output", data, "--tasks", str(TASKS), "--dry-run")
    said = call(slurm, *arguments, "--set", "cluster.memory=1G", "--set", f"cluster.image={sif}")
    begin = said.index("#!")
    (shared / "collect.sh").write_text(said[begin:])
    # The lines before the script name the other commands to run.
    plan, logs, join = (shlex.split(line.rpartition(": ")[2]) for line in said[:begin].splitlines())
    inside = ("apptainer", "--quiet", "exec", str(sif))
    slurm.run(*inside, *plan, user=USER, cwd=shared)
    slurm.run(*logs, user=USER, cwd=shared)
    slurm.run("sbatch", "--wait", "collect.sh", user=USER, cwd=shared)
    slurm.run(*inside, *join, user=USER, cwd=shared)
    assert fingerprints(data) == whole


def test_the_file_of_the_site_gives_defaults_for_cluster_keys(
    slurm: Slurm, short: tuple[Path, dict[str, str]], tmp_path: Path
) -> None:
    site = tmp_path / "throwcollect" / "cluster.yaml"
    site.parent.mkdir()
    site.write_text("partition: low\ntime: 0:30:00\n")
    arguments = ("submit", short[0], "--output", tmp_path / "data", "--tasks", str(TASKS), "--dry-run", "--set")
    said = call(slurm, *arguments, "cluster.time=0:10:00", XDG_CONFIG_HOME=str(tmp_path))
    assert "#SBATCH --partition=low" in said
    assert "#SBATCH --time=0:10:00" in said
    site.write_text("partition: low\ntiem: 30\n")
    said = call(slurm, *arguments, "cluster.time=0:10:00", expect=2, XDG_CONFIG_HOME=str(tmp_path))
    assert "cluster.yaml:2: tiem: unknown key" in said


def test_an_array_task_near_its_time_limit_goes_on_without_disturbing_others(
    slurm: Slurm, limited: tuple[Path, dict[str, str]]
) -> None:
    data, whole = limited
    call(slurm, "wait", "--run", data)
    assert recordings(fingerprints(data)) == whole
    struck = call(slurm, "logs", "1", "--run", data)
    assert (
        struck.count("slice 1/2: trials 15 to 44") == struck.count("interrupted: finishing the running trials") + 1 > 1
    )
    assert "nothing is left to do" not in call(slurm, "logs", "0", "--run", data)
