"""`throwcollect up --runtime docker`: the same files as with processes, whatever happens to containers and launcher."""

from __future__ import annotations

import json
import os
import random
import signal
import time
from collections.abc import Iterator
from pathlib import Path

import docker
import pytest

from tests.docker.collection import pause
from tests.e2e.collection import FAST, SEEING, Running, call, collect_here, fingerprints, start, write_config
from throwcollect.collect.runtimes.docker.container_options import DIRECTORY_LABEL
from throwcollect.collect.runtimes.docker.docker_engine import default_tag

pytestmark = [pytest.mark.docker, pytest.mark.usefixtures("client")]


@pytest.fixture(scope="module")
def config(tmp_path_factory: pytest.TempPathFactory) -> Path:
    # Slow enough that a collection outlasts the interventions of a test, with few trials to compute.
    return write_config(tmp_path_factory.mktemp("config"), trials=16, sim=f"{FAST}, real_time_factor: 4")


@pytest.fixture
def engine(tmp_path: Path) -> Iterator[docker.DockerClient]:
    """The engine; afterwards nothing of the runs of the test may be left on it."""
    client, filters = docker.from_env(), {"label": DIRECTORY_LABEL}
    yield client
    found = [*client.api.containers(all=True, filters=filters), *client.api.networks(filters=filters)]
    found += client.api.volumes(filters=filters)["Volumes"] or ()
    assert [each for each in found if each["Labels"][DIRECTORY_LABEL].startswith(str(tmp_path))] == []
    client.close()


def containers_of(client: docker.DockerClient, directory: Path) -> dict[str, docker.models.containers.Container]:
    filters = {"label": f"{DIRECTORY_LABEL}={directory}"}
    return {each.labels["throwcollect.node"]: each for each in client.containers.list(filters=filters)}


def test_resume_completes_a_collection_after_kills_and_pauses_at_random(
    engine: docker.DockerClient, tmp_path: Path
) -> None:
    """Nodes of each kind are killed, a simulation is paused; then the launcher dies, and leaves its containers.

    What sensors saw is the same, too.
    """
    # Slow enough that the collection outlives all kills even on a fast machine.
    config = write_config(tmp_path, trials=30, text=SEEING, sim=f"{FAST}, real_time_factor: 2")
    directory = tmp_path / "data"
    collect_here(config, tmp_path / "undisturbed")
    running = start(config, directory, 3, "--runtime", "docker")
    running.wait_until(lambda: running.count_bytes() > 0)
    chance = random.Random(time.time_ns())
    harms = ["sim_1", "sim_2", "router", "coordinator"]
    chance.shuffle(harms)
    for name in harms:
        # A node that is just being restarted is missing.
        if node := containers_of(engine, directory).get(name):
            pause(node) if name == "sim_2" else node.kill()
        time.sleep(chance.uniform(0.2, 2.0))
    running.wait_until(lambda: "sim_1" in containers_of(engine, directory))
    running.process.send_signal(signal.SIGKILL)
    running.process.communicate()
    left = containers_of(engine, directory)
    assert {"router", "coordinator"} & left.keys()
    resumed = call("resume", directory, "-n", "2", "--runtime", "docker")
    assert resumed.returncode == 0, resumed.stderr
    assert "its launcher had ended before its containers; they are ended now" in resumed.stderr
    assert fingerprints(directory) == fingerprints(tmp_path / "undisturbed")
    provenance = json.loads((directory / "provenance.json").read_text(encoding="utf-8"))
    assert provenance["image"] == engine.images.get(default_tag()).id
    assert {path.stat().st_uid for path in directory.rglob("*")} == {os.getuid()}


def test_ctrl_c_leaves_no_containers_networks_or_keys_behind(
    config: Path, engine: docker.DockerClient, tmp_path: Path
) -> None:
    running: Running = start(config, tmp_path / "data", 1, "--runtime", "docker", "--trials", "40")
    running.wait_until(lambda: running.count_bytes() > 0)
    running.process.send_signal(signal.SIGINT)
    code, _, err = running.finish()
    assert (code, "interrupted; finished throws are in" in err) == (130, True), err
