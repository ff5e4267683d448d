"""Collections on Docker Compose, as the documentation shows them."""

from __future__ import annotations

import os
import re
import shutil
import signal
import subprocess
import time
from pathlib import Path

import pytest

from tests.e2e.collection import FAST, collect_here, fingerprints, write_config
from tests.pages import read_section
from throwcollect.collect.runtimes.docker.docker_engine import connect

pytestmark = [pytest.mark.docker, pytest.mark.usefixtures("client")]
ROOT = Path(__file__).parents[2]
SCRIPT = ROOT / "compose" / "collect.sh"
DOCUMENT = read_section("running.md", "Docker Compose and continuous integration")
COMMAND = "compose/collect.sh configs/quickstart.yaml 4 dataset"
_ARM = (ROOT / "configs" / "panda.yaml").read_text(encoding="utf-8").replace("{", "{{").replace("}", "}}")
PANDA = re.sub(r"^trials: .*", "trials: {trials}", _ARM, flags=re.MULTILINE)


PLUGINS = ROOT / "build" / "docker-config"
"""Where continuous integration puts Compose v2 if the machine has none."""


def answers(environment: dict[str, str], *command: str) -> bool:
    try:
        return subprocess.run(command, env=environment, capture_output=True, check=False).returncode == 0
    except FileNotFoundError:
        return False


@pytest.fixture(params=["v2", "1.29"])
def environment(request: pytest.FixtureRequest, tmp_path: Path) -> dict[str, str]:
    """An environment in which the script finds this version of Compose, and no other."""
    variables = dict(os.environ)
    if request.param == "v2":
        if not answers(variables, "docker", "compose", "version"):
            variables["DOCKER_CONFIG"] = str(PLUGINS)
        if not answers(variables, "docker", "compose", "version"):
            pytest.skip("no Docker Compose v2 here")
    else:
        variables["DOCKER_CONFIG"] = str(tmp_path / "no-plugins")
        if not answers(variables, "docker-compose", "version"):
            pytest.skip("no Docker Compose 1.29 here")
        if answers(variables, "docker", "compose", "version"):
            pytest.skip("Compose v2 is installed for all users; the script prefers it")
    return variables


def leftovers() -> str:
    parts = [["ps", "-aq"], ["network", "ls", "-q"], ["volume", "ls", "-q"]]
    label = ["--filter", "label=com.docker.compose.project"]
    return "".join(
        subprocess.run(["docker", *part, *label], capture_output=True, text=True, check=False).stdout for part in parts
    )


def run(environment: dict[str, str], *arguments: str | Path, cwd: Path = ROOT) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [str(argument) for argument in arguments],
        env=environment,
        cwd=cwd,
        capture_output=True,
        text=True,
        timeout=300,
        check=False,
    )


@pytest.mark.parametrize("environment", ["1.29"], indirect=True)
def test_compose_of_version_1_collects_throws_of_a_described_robot(environment: dict[str, str], tmp_path: Path) -> None:
    """Other tests collect with Talos on version 2."""
    config = write_config(tmp_path, trials=24, text=PANDA, sim=FAST)
    collect_here(config, tmp_path / "here")
    before = leftovers()
    output = tmp_path / "data"
    done = run(environment, SCRIPT, config, "1", output)
    assert done.returncode == 0, done.stdout + done.stderr
    assert fingerprints(output) == fingerprints(tmp_path / "here")
    assert {path.stat().st_uid for path in output.iterdir()} == {os.getuid()}
    assert leftovers() == before


def test_the_exit_code_is_that_of_the_collection(environment: dict[str, str], tmp_path: Path) -> None:
    before = leftovers()
    (tmp_path / "wrong.yaml").write_text("name: wrong\ntrials: 0\n")
    done = run(environment, SCRIPT, tmp_path / "wrong.yaml", "1", tmp_path / "data")
    assert done.returncode == 2, done.stdout + done.stderr
    assert "wrong.yaml:2: trials: should be" in done.stdout + done.stderr
    none = run(environment, SCRIPT, tmp_path / "wrong.yaml", "0", tmp_path / "data")
    assert (none.returncode, none.stderr.count("\n")) == (2, 1)
    assert "0 simulations; a whole number from 1 on is wanted" in none.stderr
    assert leftovers() == before


@pytest.mark.parametrize("environment", ["v2"], indirect=True)
def test_the_documented_command_runs(environment: dict[str, str], tmp_path: Path) -> None:
    assert len(re.findall(rf"^.*{re.escape(COMMAND)}$", DOCUMENT, flags=re.MULTILINE)) == 3
    for name in ("compose", "configs"):
        shutil.copytree(ROOT / name, tmp_path / name)
    # The command is the documented one, and a few throws are enough to show that it works.
    config = tmp_path / "configs" / "quickstart.yaml"
    few = re.sub(r"^trials: .*", "trials: 8", config.read_text(encoding="utf-8"), flags=re.MULTILINE)
    config.write_text(few, encoding="utf-8")
    before = leftovers()
    done = run(environment, *COMMAND.split(), cwd=tmp_path)
    assert done.returncode == 0, done.stdout + done.stderr
    assert "8 landed" in done.stdout
    collect_here(config, tmp_path / "here")
    assert fingerprints(tmp_path / "dataset") == fingerprints(tmp_path / "here")
    assert {path.stat().st_uid for path in (tmp_path / "dataset").iterdir()} == {os.getuid()}
    assert leftovers() == before
    again = run(environment, *COMMAND.split(), cwd=tmp_path)
    assert (again.returncode, again.stderr) == (2, "compose/collect.sh: dataset exists already\n")


@pytest.mark.parametrize("environment", ["v2"], indirect=True)
def test_a_node_that_dies_is_started_again(environment: dict[str, str], tmp_path: Path) -> None:
    # Slow enough that the collection outlives both kills even on a fast machine.
    config = write_config(tmp_path, trials=30, sim=f"{FAST}, real_time_factor: 2")
    collect_here(config, tmp_path / "undisturbed")
    command = [str(SCRIPT), str(config), "2", str(tmp_path / "data")]
    process = subprocess.Popen(command, env=environment, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
    project = f"throwcollect-{process.pid}"
    for service in ("sim", "router"):
        kill_node_of(project, service)
    out, _ = process.communicate(timeout=200)
    assert process.returncode == 0, out
    assert len(re.findall(r"sim_\w+ is ready", out)) == 3, out
    assert len(re.findall(r"router listening", out)) == 2, out
    assert fingerprints(tmp_path / "data") == fingerprints(tmp_path / "undisturbed")


def kill_node_of(project: str, service: str) -> None:
    """Wait until the node in a container of a service works, and end it."""
    labels = [f"com.docker.compose.project={project}", f"com.docker.compose.service={service}"]
    client, deadline = connect(), time.monotonic() + 60
    while time.monotonic() < deadline:
        for container in client.containers.list(filters={"label": labels})[:1]:
            if b"ready" in container.logs() or b"listening" in container.logs():
                time.sleep(2.0)
                for row in container.top()["Processes"]:
                    if f"throwcollect {service} " in row[-1] and "until" not in row[-1]:
                        os.kill(int(row[1]), signal.SIGKILL)
                        return
        time.sleep(0.2)
    raise AssertionError(f"no {service} to kill")
