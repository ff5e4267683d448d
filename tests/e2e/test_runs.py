"""Runs that outlive the terminal in which they were started."""

import json
import os
import re
import signal
import subprocess
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import psutil
import pytest

from tests.commands import start_command
from tests.e2e.collection import (
    FAST,
    call,
    call_here,
    collect_here,
    fingerprints,
    start,
    write_config,
)
from throwcollect.collect.runs.records import Records
from throwcollect.state_directory import STATE_VARIABLE

pytestmark = pytest.mark.e2e
TRIALS = 16
SLOWLY = ("--set", "sim.real_time_factor=1")
"""Makes a run last long enough for commands to look at it."""
MANY = 100
UNTIL_STOPPED = ("--trials", str(MANY), *SLOWLY)
"""Makes a run outlast any test, as it takes more than a minute."""


@pytest.fixture(scope="module")
def config(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_config(tmp_path_factory.mktemp("config"), trials=TRIALS, sim=FAST)


@pytest.fixture(scope="module")
def reference(config: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A collection that nobody disturbed."""
    directory = tmp_path_factory.mktemp("reference") / "data"
    collect_here(config, directory)
    return directory


@pytest.fixture(autouse=True)
def records(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Records]:
    """Records of the runs of one test; runs that it leaves are ended afterwards."""
    monkeypatch.setenv(STATE_VARIABLE, str(tmp_path / "state"))
    # Without an engine, no runs of other users on this machine are seen.
    monkeypatch.setenv("DOCKER_HOST", f"unix://{tmp_path}/none.sock")
    records = Records()
    yield records
    for run in records.all():
        if run.lives:
            os.kill(run.record.launcher, signal.SIGKILL)


def say(*arguments: str | Path) -> tuple[int, str, str]:
    """The command, called in this process: exit code, output, errors."""
    said = call_here(*arguments)
    return said.returncode, said.stdout, said.stderr


def begin(records: Records, config: Path, directory: Path, *options: str) -> str:
    """Start a run in a process of its own, which is forked in no time; returns its id."""
    words = ("up", config, "--output", directory, "-n", "1", *options)
    start_command(*words, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    found: list[str] = []

    def runs() -> bool:
        found[:] = [run for run in records.ids() if status(records, run, "coordinator") == "running"]
        return bool(found)

    until(runs)
    return found[0]


def list_runs(*options: str) -> list[dict[str, Any]]:
    said = call_here("ps", "--json", *options)
    assert (said.returncode, said.stderr) == (0, "")
    documents: list[dict[str, Any]] = json.loads(said.stdout)
    return documents


def until(condition: Callable[[], bool], *, seconds: float = 60) -> None:
    deadline = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < deadline, "did not happen"
        time.sleep(0.05)


def in_the_middle(records: Records, run: str, ended: int = 2) -> None:
    until(lambda: (progress := records.get(run).record.progress) is not None and progress.ended >= ended)


def nodes(records: Records, run: str) -> dict[str, psutil.Process]:
    return {node.name: psutil.Process(int(node.handle)) for node in records.get(run).record.nodes if node.handle}


def status(records: Records, run: str, name: str) -> str | None:
    return next((node.status for node in records.get(run).record.nodes if node.name == name), None)


def handle(records: Records, run: str, name: str) -> str:
    return next(node.handle or "" for node in records.get(run).record.nodes if node.name == name)


def assert_gone(processes: dict[str, psutil.Process]) -> None:
    _, alive = psutil.wait_procs(list(processes.values()), timeout=10)
    assert alive == []


def test_another_command_can_wait_for_a_detached_run(
    config: Path, reference: Path, records: Records, tmp_path: Path
) -> None:
    said = call("up", "-d", config, "--output", tmp_path / "data")
    run = said.stdout.strip()
    assert re.fullmatch(r"small-[0-9a-f]{4}", run)
    assert f"follow it: throwcollect wait --run {run}" in said.stderr
    record = records.get(run).record
    # The launcher has a session of its own, so that closing a terminal does not end it.
    assert os.getsid(record.launcher) == record.launcher
    assert [node.name for node in record.nodes] == ["router", "sim_0", "sim_1", "coordinator"]
    waited = call("wait")
    assert waited.returncode == 0, waited.stderr
    info = call_here("dataset", "info", tmp_path / "data").stdout
    assert waited.stdout.startswith(info)
    assert "look into it: throwcollect dataset info" in waited.stdout
    assert fingerprints(tmp_path / "data") == fingerprints(reference)
    assert list_runs() == []
    (ended,) = list_runs("-a")
    assert (ended["run"], ended["status"], ended["exit_code"], ended["progress"]["ended"]) == (run, "ended", 0, TRIALS)
    # Waiting for a run that is over gives the same answer.
    again = call_here("wait", "--run", tmp_path / "data", "--json")
    assert (again.returncode, again.stderr) == (0, "")
    assert (
        json.loads(again.stdout).items()
        >= json.loads(call_here("dataset", "info", tmp_path / "data", "--json").stdout).items()
    )


def test_scaling_and_losses_do_not_change_the_dataset(config: Path, records: Records, tmp_path: Path) -> None:
    few = ("--trials", "24", *SLOWLY)
    collect_here(config, tmp_path / "reference", *few)
    run = begin(records, config, tmp_path / "data", *few)
    assert call_here("scale", "3").stdout == f"{run}: 1 -> 3 simulations\n"
    until(lambda: status(records, run, "sim_2") == "running")
    assert records.get(run).record.simulations == 3
    first = handle(records, run, "sim_0")
    os.kill(int(first), signal.SIGKILL)
    until(lambda: handle(records, run, "sim_0") not in ("", first))
    removed = nodes(records, run)["sim_2"]
    assert call_here("scale", "2", "--run", run[:-1]).returncode == 0
    assert_gone({"sim_2": removed})
    waited = call_here("wait")
    assert waited.returncode == 0, waited.stderr
    # Standard error has this as well, unless the run was over before `wait` began.
    assert re.search(r"^trials +24: 24 landed$", waited.stdout, re.MULTILINE)
    assert fingerprints(tmp_path / "data") == fingerprints(tmp_path / "reference")
    told = [re.sub(r": \d+$", "", line.split("  ", 1)[1]) for line in call_here("events").stdout.splitlines()]
    for line in (
        f"{run} scaled: 3 simulations",
        "sim_0 lost: ended by SIGKILL",
        "sim_0 restarting",
        f"{run} scaled: 2 simulations",
        "sim_2 removed",
        f"{run} finished",
    ):
        assert told.count(line) == 1, told
    assert told.count("sim_0 started") == 2
    assert told.index("sim_2 ready") < told.index("sim_2 removed")


def test_stop_ends_a_run_as_ctrl_c_does(config: Path, records: Records, tmp_path: Path) -> None:
    run = begin(records, config, tmp_path / "data", *UNTIL_STOPPED)
    in_the_middle(records, run)
    processes = nodes(records, run)
    stopped = call("stop")
    assert (stopped.returncode, stopped.stdout) == (
        0,
        f"{run}: stopped; the dataset is not complete: {tmp_path / 'data'}\n",
    )
    assert_gone(processes)
    assert (tmp_path / "data" / "small_00000.mcap.part").exists()
    ending = f"throwcollect: interrupted; finished throws are in {tmp_path / 'data'}, the dataset is not complete\n"
    assert say("wait") == (130, "", f"{ending}  try: throwcollect resume {tmp_path / 'data'}\n")
    hint = "  try: throwcollect ps lists those that live\n"
    assert say("stop", "--run", run) == (2, "", f"throwcollect: run {run} has ended\n{hint}")


def test_down_ends_everything_and_keeps_the_directory(config: Path, records: Records, tmp_path: Path) -> None:
    run = begin(records, config, tmp_path / "data", *UNTIL_STOPPED)
    in_the_middle(records, run)
    processes = nodes(records, run)
    said = call_here("down")
    assert (said.returncode, said.stdout) == (0, f"{run}: ended and forgotten\n")
    assert_gone(processes)
    assert list_runs("-a") == []
    assert list((tmp_path / "state" / "runs").iterdir()) == []
    assert (tmp_path / "data" / "small_00000.mcap.part").stat().st_size > 0


def test_a_killed_launcher_ends_its_nodes_and_commands_report_its_death(
    config: Path, records: Records, tmp_path: Path
) -> None:
    run = begin(records, config, tmp_path / "data", *UNTIL_STOPPED)
    in_the_middle(records, run, 1)
    processes = nodes(records, run)
    os.kill(records.get(run).record.launcher, signal.SIGKILL)
    assert_gone(processes)
    code, table, _ = say("ps")
    assert code == 0
    assert re.search(rf"^{run} +local +1 +\d+/{MANY} +died +{tmp_path / 'data'}$", table, flags=re.MULTILINE)
    for verb in (["wait"], ["stop", "--run", run], ["scale", "3", "--run", run]):
        code, out, err = say(*verb)
        assert (verb, code, out) == (verb, 3, "")
        assert f"throwcollect: run {run}: its launcher died; finished throws are in {tmp_path / 'data'}" in err
        assert f"try: throwcollect resume {tmp_path / 'data'} goes on where it ended" in err
        assert f"throwcollect down --run {run} cleans up" in err
    code, _, err = say("up", config, "--output", tmp_path / "data")
    assert (code, f"{tmp_path / 'data'}: holds config.yaml, logs, plan.parquet" in err) == (2, True)
    assert say("down") == (0, f"{run}: ended and forgotten\n", "")
    assert records.ids() == []


def test_other_commands_see_and_control_a_run_in_the_foreground(config: Path, records: Records, tmp_path: Path) -> None:
    running = start(config, tmp_path / "data", 1, *UNTIL_STOPPED)
    running.wait_until(lambda: bool(records.ids()))
    (run,) = records.ids()
    in_the_middle(records, run)
    second = call_here("up", config, "--output", tmp_path / "data")
    assert (second.returncode, second.stdout) == (2, "")
    assert second.stderr == (
        f"throwcollect: {tmp_path / 'data'}: run {run} collects into it\n"
        f"  try: throwcollect wait --run {run} follows it\n"
    )
    # A command with other records is refused as well, before it changes anything.
    plan = (tmp_path / "data" / "plan.parquet").read_bytes()
    elsewhere = {STATE_VARIABLE: str(tmp_path / "other")}
    third = call("resume", tmp_path / "data", "--trials", str(MANY + 1), **elsewhere)
    assert (third.returncode, third.stdout) == (4, "")
    assert f"throwcollect: {tmp_path / 'data'}: another process collects into it" in third.stderr
    assert (tmp_path / "data" / "plan.parquet").read_bytes() == plan
    table = call_here("ps").stdout.splitlines()
    assert table[0].split() == ["RUN", "RUNTIME", "SIMULATIONS", "THROWS", "STATUS", "DATASET"]
    assert [line.split()[:2] for line in table[1:]] == [
        [run, "local"],
        ["router", "running"],
        ["sim_0", "running"],
        ["coordinator", "running"],
    ]
    assert call_here("stop").returncode == 0
    code, out, err = running.finish()
    assert (code, out) == (130, "")
    assert "interrupted: finishing the running trials; once more ends at once" in err


@pytest.fixture
def viewed() -> Iterator[str]:
    """The address of a server that `view` has begun."""
    yield json.loads(call_here("view", "--json").stdout)["url"]
    call_here("down", "--run", "server")


def test_ps_lists_the_server_that_view_begins_and_stop_ends_it_by_its_name(
    config: Path, records: Records, viewed: str, tmp_path: Path
) -> None:
    (listed,) = list_runs()
    assert json.loads(call_here("view", "--json").stdout)["url"] == viewed
    assert listed == {"run": "server", "kind": "server", "status": "running", "url": viewed, "pid": listed["pid"]}
    row = ("server", "-", "-", "-", "running", "at", f"{viewed},", "pid", str(listed["pid"]), "-")
    assert tuple(say("ps")[1].splitlines()[1].split()) == row
    run = begin(records, config, tmp_path / "data", *UNTIL_STOPPED)
    assert [each["run"] for each in list_runs()] == [run, "server"]
    assert say("stop")[1].startswith(f"{run}: stopped")
    assert list_runs() == [listed]
    assert say("stop", "--run", "server") == (0, f"server: stopped; it was at {viewed}\n", "")
    assert list_runs() == []
    assert say("stop", "--run", "server")[0] == 2
