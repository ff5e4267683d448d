"""Nodes as containers of a real engine."""

from __future__ import annotations

import json
import os
import re
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from docker.client import DockerClient
from docker.models.containers import Container

from tests.cut_line import CutLine
from tests.docker.collection import (
    TRIALS,
    Collection,
    collecting,
    config_file,
    config_for,
    key_in,
    new_run,
    pause,
    place_of,
)
from tests.e2e.collection import collect_here
from throwcollect.collect.coordinator.prepare import prepare
from throwcollect.collect.runtimes.docker.containers import remove
from throwcollect.collect.runtimes.docker.docker_engine import connect
from throwcollect.collect.runtimes.docker.docker_nodes import DockerNodes
from throwcollect.collect.runtimes.nodes import COORDINATOR, ROUTER, NodeRole, NodeSpec
from throwcollect.dataset.inspect import info
from throwcollect.errors import WorkerError

pytestmark = pytest.mark.docker

MEMORY_HOG = """
import os
for pid in filter(str.isdecimal, os.listdir('/proc')):
    if int(pid) not in (1, os.getpid()):
        open(f'/proc/{pid}/oom_score_adj', 'w').write('1000')
hog = bytearray(1 << 30)
"""


@pytest.fixture(scope="module")
def digest(tmp_path_factory: pytest.TempPathFactory) -> str:
    """Digest of the dataset, collected without containers."""
    directory = tmp_path_factory.mktemp("here")
    collect_here(config_file(directory), directory / "dataset")
    return info(directory / "dataset").digest


def until(condition: Callable[[], bool], *, seconds: float = 60) -> None:
    deadline = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < deadline, "did not happen"
        time.sleep(0.02)


def container(client: DockerClient, collection: Collection, node: str) -> Container:
    handle = collection.runtime.handle(node)
    assert handle is not None
    return client.containers.get(handle)


def list_what_is_left(client: DockerClient, label: str) -> list[Any]:
    filters = {"label": label}
    containers, networks = client.containers.list(all=True, filters=filters), client.networks.list(filters=filters)
    return [*containers, *networks]


def test_a_collection_in_containers_yields_the_dataset_of_one_in_processes(
    client: DockerClient, tmp_path: Path, digest: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    caller = os.getuid() or 4242  # root can give files to any user
    monkeypatch.setattr(os, "getuid", lambda: caller)
    run = new_run()
    prepared = tmp_path / "dataset"
    prepare(config_for(tmp_path), prepared, sweep_directory=tmp_path)
    (prepared / "logs").mkdir()
    key = key_in(tmp_path).directory
    for path in (prepared, *prepared.iterdir(), key, *key.iterdir()):
        os.chown(path, caller, -1)
    with collecting(client, tmp_path, "containers.sim.memory=512m", run=run) as collection:
        collection.until(lambda: collection.status("sim_1") == "running")
        for node in collection.runtime.running():
            running = container(client, collection, node)
            details = running.attrs
            host = details["HostConfig"]
            assert (host["Privileged"], host["PidMode"], host["CapDrop"], host["CapAdd"]) == (False, "", ["ALL"], None)
            assert (host["ReadonlyRootfs"], host["SecurityOpt"], host["Init"]) == (True, ["no-new-privileges"], True)
            assert host["NetworkMode"] == f"throwcollect-{run}"
            assert (host["Memory"] == 512 * 1024**2) == node.startswith("sim")
            assert not any((*(host["PortBindings"] or {}), *details["NetworkSettings"]["Ports"].values()))
            mounts = {each["Destination"]: (each["Source"], each["RW"]) for each in details["Mounts"]}
            assert mounts.pop("/key")[1] is False
            assert mounts == ({} if node == ROUTER else {"/data": (str(prepared), node == COORDINATOR)})
            sockets = running.exec_run(["cat", "/proc/net/tcp", "/proc/net/tcp6"]).output.decode()
            listening = [line.split()[1] for line in sockets.splitlines() if " 0A " in line]
            assert not [address for address in listening if set(address.split(":")[0]) == {"0"}]
            assert any(address.endswith(":1D17") for address in listening) == (node == ROUTER)
        assert client.networks.get(f"throwcollect-{run}").attrs["Internal"]
        assert collection.finish() == digest
    assert list_what_is_left(client, f"throwcollect.run={run}") == []
    assert {path.stat().st_uid for path in prepared.iterdir()} == {caller}
    assert "sim_0 is ready" in (prepared / "logs" / "sim_0.log").read_text()
    assert re.search(rf"^{TRIALS}/{TRIALS} throws", (prepared / "logs" / "coordinator.log").read_text(), re.MULTILINE)


def test_simulations_that_are_killed_paused_or_out_of_memory_are_named_and_replaced(
    client: DockerClient, tmp_path: Path, digest: str
) -> None:
    with collecting(client, tmp_path, "run.simulations=1", "run.retries=9", "containers.sim.memory=400m") as collection:
        collection.until_more_is_written()
        container(client, collection, "sim_0").kill()
        collection.until(lambda: any("ended by SIGKILL" in line for line in collection.news))
        collection.until_more_is_written()
        container(client, collection, "sim_0").exec_run(["python3", "-c", MEMORY_HOG])
        collection.until(lambda: any("ran out of memory (limit 400m)" in line for line in collection.news))
        collection.until_more_is_written()
        pause(container(client, collection, "sim_0"))
        collection.until(lambda: any("sim_0 is frozen" in line for line in collection.news))
        collection.until_more_is_written()
        assert collection.finish() == digest
        assert all(line.startswith("sim_0") for line in collection.news)
    log = (collection.directory / "logs" / "sim_0.log").read_text()
    assert log.count("sim_0 is ready\n") == 4


def test_a_router_that_comes_back_at_another_address_is_found_again(
    client: DockerClient, tmp_path: Path, digest: str
) -> None:
    with collecting(client, tmp_path, "run.simulations=1") as collection:
        collection.until_more_is_written()
        endpoint = collection.runtime.endpoint
        router = container(client, collection, ROUTER)
        network = router.attrs["HostConfig"]["NetworkMode"]
        squatter = client.containers.create(
            router.image, ["router", "--listen", "tcp/127.0.0.1:7447"], network=network, labels=router.labels
        )
        router.kill()
        squatter.start()
        collection.until(lambda: collection.runtime.endpoint not in (endpoint, None))
        assert collection.finish() == digest
        assert collection.news == [
            "router was lost (ended by SIGKILL) and is started again; its log ends: router listening on tls/router:7447"
        ]


def test_runs_side_by_side_do_not_disturb_one_another(client: DockerClient, tmp_path: Path, digest: str) -> None:
    (tmp_path / "one").mkdir()
    (tmp_path / "other").mkdir()
    with (
        collecting(client, tmp_path / "other", "run.simulations=1") as other,
        collecting(client, tmp_path / "one", "run.simulations=1") as collection,
    ):
        assert collection.finish() == digest
        collection.supervisor.host.close()
        assert other.finish() == digest


@pytest.fixture
def bare(client: DockerClient, tmp_path: Path) -> Any:
    """A function that makes runtimes without a dataset, for nodes that need none."""
    made: list[tuple[DockerNodes, str]] = []

    def make(*overrides: str, through: DockerClient = client) -> DockerNodes:
        run = new_run()
        context = place_of(run, tmp_path, key_in(tmp_path))
        runtime = DockerNodes(context, config_for(tmp_path, *overrides), client=through)
        made.append((runtime, run))
        runtime.open()
        return runtime

    yield make
    for runtime, run in made:
        runtime.close()
        remove(client, run)


def test_a_node_gets_the_key_as_private_files_that_the_engine_does_not_show(
    bare: Any, client: DockerClient, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(os, "getuid", lambda: 4242)
    key = key_in(tmp_path).private_key.read_text()
    for path in (tmp_path / "key", *(tmp_path / "key").iterdir()):
        os.chown(path, 4242, -1)
    runtime = bare()
    runtime.start(NodeSpec(ROUTER, ("router", "--listen", runtime.listen), NodeRole.EXPENDABLE))
    until(lambda: runtime.logs.tail(ROUTER) != "")
    assert runtime.logs.tail(ROUTER) == "router listening on tls/router:7447"
    router = client.containers.get(runtime.handle(ROUTER))
    script = "stat -c '%a %u' /key/*; touch /key/new; cat /key/key.pem"
    said = router.exec_run(["sh", "-c", script]).output.decode()
    # The engine may deliver the two output streams in another order than they were printed.
    assert "600 4242\n600 4242\n" in said
    assert "/key/new': Read-only file system" in said
    assert key in said
    (mount,) = (each for each in router.attrs["Mounts"] if each["Destination"] == "/key")
    assert (mount["Type"], mount["RW"]) == ("bind", False)
    told = json.dumps(router.attrs)
    assert not any(line in told for line in key.splitlines())
    runtime.close()


def test_a_container_gets_the_configured_mounts_environment_and_networks(
    bare: Any, client: DockerClient, tmp_path: Path
) -> None:
    network = client.networks.create(new_run())
    try:
        (tmp_path / "extra").write_text("extra")
        runtime = bare(
            f"containers.router.mounts=['{tmp_path}/extra:/extra:ro']",
            "containers.router.environment={ANSWER: 42}",
            f"containers.router.networks=[{network.name}]",
            "containers.router.cpuset='0'",
            "containers.router.options={ulimits: {nofile: 99}, tmpfs: {/tmp: size=1m}}",
        )
        runtime.start(NodeSpec(ROUTER, ("router", "--listen", runtime.listen), NodeRole.EXPENDABLE))
        until(lambda: runtime.logs.tail(ROUTER) != "")
        script = (
            "cat /extra; echo $ANSWER; ulimit -n; grep Cpus_allowed_list /proc/self/status; grep ' /tmp ' /proc/mounts"
        )
        router = client.containers.get(runtime.handle(ROUTER))
        said = router.exec_run(["sh", "-c", script]).output.decode()
        assert said.splitlines()[:2] == ["extra42", "99"]
        assert re.search(r"Cpus_allowed_list:\s0\n", said)
        assert re.search(r"tmpfs /tmp tmpfs rw,nosuid,nodev,noexec,relatime,size=1024k", said)
        assert network.name in router.attrs["NetworkSettings"]["Networks"]
        runtime.close()
    finally:
        network.remove()


@pytest.fixture
def line(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> CutLine:
    line = CutLine(f"{tmp_path}/line.sock", "/var/run/docker.sock")
    monkeypatch.setenv("DOCKER_HOST", f"unix://{tmp_path}/line.sock")
    return line


@pytest.mark.parametrize(("trouble", "evidence"), [("cut", "Connection refused\n"), ("clog", "no answer in time\n")])
def test_a_silent_engine_is_an_error_that_names_containers_that_may_run_on(
    monkeypatch: pytest.MonkeyPatch,
    line: CutLine,
    bare: Any,
    client: DockerClient,
    trouble: str,
    evidence: str,
) -> None:
    monkeypatch.setattr("throwcollect.collect.runtimes.docker.containers.SILENCE_S", 3.0)
    runtime = bare(through=connect(timeout_s=10.0))
    runtime.start(NodeSpec(ROUTER, ("router", "--listen", runtime.listen), NodeRole.EXPENDABLE))
    until(lambda: runtime.logs.tail(ROUTER) != "")
    handle = runtime.handle(ROUTER)
    getattr(line, trouble)()
    with pytest.raises(WorkerError, match=r"engine has not answered for \d+ s") as caught:
        until(lambda: bool(runtime.exits()))
    left = client.containers.get(handle).name
    assert (caught.value.evidence, caught.value.exit_code) == (f"{evidence}containers that may run on: {left}", 3)
    runtime.close()
    assert not runtime.cleared
    assert client.containers.get(handle).status == "running"
