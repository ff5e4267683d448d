"""Collections on genuine rclpy: their datasets, and which nodes see them."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from tests.e2e.collection import (
    FAST,
    Running,
    call,
    collect,
    collect_here,
    fingerprints,
    journal,
    start,
    words_of,
    write_config,
)
from throwcollect.collect.runs.records import Records
from throwcollect.errors import WorkerError
from throwcollect.state_directory import STATE_VARIABLE

TRIALS = 8
DOMAIN = "83"

LOOK = """
import json, time, rclpy

rclpy.init()
node = rclpy.create_node("stranger")
seen = set()
deadline = time.monotonic() + 4
while time.monotonic() < deadline:
    rclpy.spin_once(node, timeout_sec=0.1)
    seen |= set(node.get_node_names()) | {name for name, _ in node.get_topic_names_and_types() if "sim_" in name}
print(json.dumps(sorted(seen - {"stranger"})))
"""
"""A genuine node without throwcollect, which lists nodes and topics."""

JOIN = """
import rclpy
from rcl_interfaces.srv import GetParameters
from sensor_msgs.msg import JointState

rclpy.init()
node = rclpy.create_node("guest")
heard = []
node.create_subscription(JointState, "/sim_0/joint_states", heard.append, 10)
client = node.create_client(GetParameters, "/sim_0/sim_0/get_parameters")
assert client.wait_for_service(30)
for _ in range(10):
    # A service of rclpy may answer before it knows the client.
    answer = client.call_async(GetParameters.Request(names=["ball.mass_kg"]))
    rclpy.spin_until_future_complete(node, answer, timeout_sec=3)
    if answer.done():
        break
assert answer.result().values[0].double_value > 0
for _ in range(200):
    if heard:
        break
    rclpy.spin_once(node, timeout_sec=0.1)
print(len(heard[0].name))
"""
"""A genuine node without throwcollect, which joins the run."""


@pytest.fixture
def records(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Records:
    monkeypatch.setenv(STATE_VARIABLE, str(tmp_path / "state"))
    monkeypatch.setenv("THROWCOLLECT_ROS", "rclpy")
    return Records()


@pytest.fixture(scope="module")
def going_on(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Running]:
    """A run that goes on while tests look at it; its first trials have begun."""
    directory = tmp_path_factory.mktemp("going_on")
    options = ("--set", "sim.real_time_factor=1", "--set", f"run.domain_id={DOMAIN}")
    environment = {STATE_VARIABLE: str(directory / "state"), "THROWCOLLECT_ROS": "rclpy"}
    config = write_config(directory, trials=400, sim=FAST)
    running = start(config, directory / "data", 1, *options, **environment)
    running.wait_until(lambda: bool(entries(running, "lease")))
    yield running
    if running.process.poll() is None:
        running.process.send_signal(signal.SIGINT)
        running.process.send_signal(signal.SIGINT)
    running.finish()


def entries(running: Running, event: str) -> list[dict[str, Any]]:
    return [entry for entry in journal(running.directory) if entry["event"] == event]


@pytest.fixture(scope="module")
def reference(tmp_path_factory: pytest.TempPathFactory) -> dict[str, str]:
    directory = tmp_path_factory.mktemp("reference")
    config = write_config(directory, trials=TRIALS, sim=FAST)
    collect_here(config, directory / "data")
    return fingerprints(directory / "data")


@pytest.fixture(scope="module")
def beside(going_on: Running, tmp_path_factory: pytest.TempPathFactory) -> dict[str, str]:
    """Files of a run beside the one that goes on.

    It is in the same domain and has the same names, so that nothing but their discovery servers keeps them apart.
    """
    directory = tmp_path_factory.mktemp("beside")
    environment = {STATE_VARIABLE: str(directory / "state"), "THROWCOLLECT_ROS": "rclpy"}
    config = write_config(directory, trials=TRIALS, sim=FAST)
    collect(config, directory / "data", 1, "--set", f"run.domain_id={DOMAIN}", **environment)
    return fingerprints(directory / "data")


def test_a_killed_simulation_gives_up_its_trial_even_if_the_router_dies_too(
    reference: dict[str, str], records: Records, tmp_path: Path
) -> None:
    """A discovery server that comes back too soon is never told of the nodes that are there."""
    config = write_config(tmp_path, trials=TRIALS, sim=FAST)
    running = start(config, tmp_path / "data", 2, "--set", "sim.real_time_factor=1")

    def under_way() -> set[int]:
        """Trials that one of the simulations has been given and not handed in."""
        ended = {entry["trial"] for entry in entries(running, "commit")}
        return {entry["trial"] for entry in entries(running, "lease") if entry["simulation"].endswith("sim_0")} - ended

    running.wait_until(lambda: len(entries(running, "commit")) >= 2 and bool(under_way()))
    (trial,) = under_way()
    running.node("--name", "sim_0").kill()
    killed = time.time()
    time.sleep(1.0)
    (router,) = [each for each in running.nodes() if "router" in words_of(each)]
    router.kill()
    code, _, err = running.finish()
    assert code == 0, err
    assert "sim_0 was lost (ended by SIGKILL)" in err
    again = [entry for entry in entries(running, "lease") if entry["trial"] == trial and entry["time"] > killed]
    assert len(again) == 1
    assert again[0]["time"] < killed + 30
    collected = fingerprints(tmp_path / "data")
    for name in ("small_00000.mcap", "throws.parquet"):
        assert collected[name] == reference[name]


APART = """
import os, runpy, sys

run_module = runpy.run_module


def run_apart(*arguments, **options):
    if "--name" in sys.argv:
        os.environ["ROS_DOMAIN_ID"] = "84"
    return run_module(*arguments, **options)


runpy.run_module = run_apart
"""
"""Nodes are modules that a forked process runs."""


def test_a_coordinator_that_sees_no_simulation_ends_the_run_with_an_error(
    records: Records, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Every simulation lives in another domain than the rest of its run, as if it were behind a firewall.

    On the embedded backend: to a discovery server of Fast DDS, domains make no difference.
    """
    (tmp_path / "site").mkdir()
    (tmp_path / "site" / "sitecustomize.py").write_text(APART)
    path = os.pathsep.join([str(tmp_path / "site"), os.environ.get("PYTHONPATH", "")])
    running = start(
        write_config(tmp_path, trials=TRIALS, sim=FAST),
        tmp_path / "data",
        1,
        PYTHONPATH=path,
        THROWCOLLECT_ROS="embedded",
    )
    code, _, err = running.finish()
    assert code == WorkerError.exit_code == 3
    assert "the coordinator does not see the simulations; all of them are started again" in err
    assert "simulations have been ready for 12.5 s, twice, but the coordinator does not see them" in err
    assert "they use rmw_" in err
    assert "a firewall may keep nodes apart" in err


def test_the_dataset_does_not_depend_on_the_backend(reference: dict[str, str], beside: dict[str, str]) -> None:
    assert beside == reference


def test_only_a_shell_that_evaluates_ros_env_sees_the_run(going_on: Running, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(STATE_VARIABLE, str(going_on.directory.parent / "state"))
    plain = {name: value for name, value in os.environ.items() if not name.startswith(("THROWCOLLECT", "FASTRTPS"))}
    for way in ({}, {"ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST"}):
        assert json.loads(python(LOOK, {**plain, "ROS_DOMAIN_ID": DOMAIN, **way})) == [], way
    # As docs/ros.md says it.
    script = f'eval "$({sys.executable} -m throwcollect ros env)"; exec {sys.executable} -c "$PROGRAM"'
    # The `python3` of the shell is that of the wheels, whose RMW `ros env` compares with that of the run.
    path = os.pathsep.join([str(Path(sys.prefix, "bin")), os.environ["PATH"]])
    said = subprocess.run(
        ["bash", "-c", script],
        env={**os.environ, "PROGRAM": JOIN, "PATH": path},
        capture_output=True,
        text=True,
        timeout=90,
        check=False,
    )
    assert said.returncode == 0, said.stderr
    # The RMW prints to standard output as well, so only one line is looked for.
    assert "32" in said.stdout.splitlines()
    named = call("ros", "topic", "list", "--run", going_on.directory).stdout.splitlines()
    assert {"/sim_0/joint_states", "/sim_0/ball/odometry"} <= set(named)
    assert going_on.process.poll() is None


def test_two_runs_at_once_do_not_see_each_other(
    reference: dict[str, str], going_on: Running, beside: dict[str, str]
) -> None:
    assert beside == reference
    before = len(entries(going_on, "commit"))
    going_on.wait_until(lambda: len(entries(going_on, "commit")) > before)


def python(program: str, environment: dict[str, str]) -> str:
    found = subprocess.run(
        [sys.executable, "-c", program], env=environment, capture_output=True, text=True, timeout=60, check=False
    )
    assert found.returncode == 0, found.stderr
    # Fast DDS prints warnings to standard output, so only the last line counts.
    return found.stdout.splitlines()[-1]
