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
from tests.e2e.collection import FAST, Running, call, call_here, collect_here, fingerprints, start, write_config
from throwcollect.runtimes.docker.container_options import KEY_LABEL
from throwcollect.runtimes.docker.docker_engine import default_tag

pytestmark = [pytest.mark.docker, pytest.mark.usefixtures("client")]
LABEL = "throwcollect.run"


@pytest.fixture(scope="module")
def config(tmp_path_factory: pytest.TempPathFactory) -> Path:
    # Slow enough that a collection outlasts the interventions of a test, with few trials to compute.
    return write_config(tmp_path_factory.mktemp("config"), trials=16, sim=f"{FAST}, real_time_factor: 4")


@pytest.fixture(scope="module")
def expected(config: Path, tmp_path_factory: pytest.TempPathFactory) -> dict[str, str]:
    """Fingerprints of the files that are collected without containers."""
    directory = tmp_path_factory.mktemp("reference") / "data"
    collect_here(config, directory)
    return fingerprints(directory)


@pytest.fixture
def engine() -> Iterator[docker.DockerClient]:
    """The engine; afterwards nothing of ours may be left on it."""
    client = docker.from_env()
    before = list_what_is_left(client)
    yield client
    assert list_what_is_left(client) == before
    client.close()


def list_what_is_left(client: docker.DockerClient) -> set[str]:
    filters = {"label": LABEL}
    containers = client.containers.list(all=True, filters=filters)
    keys = client.volumes.list(filters={"label": KEY_LABEL})
    return {each.name for each in (*containers, *client.networks.list(filters=filters), *keys)}


def containers_of(client: docker.DockerClient, directory: Path) -> dict[str, docker.models.containers.Container]:
    filters = {"label": f"throwcollect.directory={directory}"}
    return {each.labels["throwcollect.node"]: each for each in client.containers.list(filters=filters)}


def test_resume_completes_a_collection_after_kills_and_pauses_at_random(
    engine: docker.DockerClient, tmp_path: Path
) -> None:
    """Simulations, router and coordinator are killed, one is paused, then the launcher dies; resuming completes it."""
    # Slow enough that the collection outlives all kills even on a fast machine.
    config = write_config(tmp_path, trials=36, sim=f"{FAST}, real_time_factor: 2")
    directory = tmp_path / "data"
    collect_here(config, tmp_path / "undisturbed")
    running = start(config, directory, 3, "--runtime", "docker")
    running.wait_until(lambda: running.count_bytes() > 0)
    chance = random.Random(time.time_ns())
    harms = ["kill", "kill", "pause", "router", "coordinator"]
    chance.shuffle(harms)
    victims = chance.sample(range(3), 3)
    for harm in harms:
        nodes = containers_of(engine, directory)
        if harm in ("router", "coordinator"):
            # A node that is just being restarted is missing.
            if harm in nodes:
                nodes[harm].kill()
        elif victim := nodes.get(f"sim_{victims.pop()}"):
            pause(victim) if harm == "pause" else victim.kill()
        time.sleep(chance.uniform(0.2, 2.0))
    assert running.process.poll() is None, running.finish()
    running.process.send_signal(signal.SIGKILL)
    running.process.communicate()
    assert {"router", "coordinator"} & containers_of(engine, directory).keys()
    time.sleep(chance.uniform(0.0, 2.0))
    resumed = call("resume", directory, "-n", "2", "--runtime", "docker")
    assert resumed.returncode == 0, resumed.stderr
    assert fingerprints(directory) == fingerprints(tmp_path / "undisturbed")


def test_down_removes_the_containers_of_a_killed_launcher(
    config: Path, engine: docker.DockerClient, tmp_path: Path
) -> None:
    directory = tmp_path / "data"
    running = start(config, directory, 1, "--runtime", "docker")
    running.wait_until(lambda: len(containers_of(engine, directory)) == 3)
    running.process.kill()
    running.process.communicate()
    done = call_here("down", "--run", directory)
    assert done.returncode == 0, done.stderr
    assert not containers_of(engine, directory)


def test_containers_have_few_privileges_and_collect_the_usual_files(
    config: Path, expected: dict[str, str], engine: docker.DockerClient, tmp_path: Path
) -> None:
    directory = tmp_path / "data"
    # The reference has one simulation, this collection has two.
    running = start(config, directory, 2, "--runtime", "docker", "--set", "containers.sim.memory=512m")
    running.wait_until(lambda: len(containers_of(engine, directory)) == 4)
    for name, container in containers_of(engine, directory).items():
        host = container.attrs["HostConfig"]
        assert (host["Privileged"], host["CapDrop"], host["CapAdd"]) == (False, ["ALL"], None)
        assert host["ReadonlyRootfs"]
        assert "no-new-privileges" in " ".join(host["SecurityOpt"])
        assert not any(host["PortBindings"] or {})
        assert not any("docker.sock" in str(mount) for mount in container.attrs["Mounts"])
        written = {mount["Destination"]: mount["RW"] for mount in container.attrs["Mounts"]}
        assert written == {"/key": False} | ({} if name == "router" else {"/data": name == "coordinator"})
        assert (host["Memory"] == 512 * 1024**2) == name.startswith("sim")
        listening = container.exec_run(["cat", "/proc/net/tcp", "/proc/net/tcp6"]).output.decode()
        addresses = [line.split()[1] for line in listening.splitlines() if " 0A " in line]
        assert not [address for address in addresses if set(address.split(":")[0]) == {"0"}]
    code, _, err = running.finish()
    assert code == 0, err
    assert fingerprints(directory) == expected
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
