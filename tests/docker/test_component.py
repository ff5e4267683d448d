"""Containers of the catalogue, on a real engine: they join a run and hear its topics."""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path

import pytest
from docker.client import DockerClient

from throwcollect.collect.runs import control
from throwcollect.collect.runs.background import begin_container, begin_run
from throwcollect.collect.runs.run import Run
from throwcollect.collect.runtimes.docker.container_options import RUN_LABEL
from throwcollect.collect.runtimes.docker.docker_engine import default_tag
from throwcollect.collect.runtimes.run_record import Origin
from throwcollect.config.run import ContainerSpec, NodeContainerConfig
from throwcollect.state_directory import STATE_VARIABLE

pytestmark = pytest.mark.docker


def until(condition: Callable[[], bool], *, seconds: float = 90) -> None:
    deadline = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < deadline, "did not happen"
        time.sleep(0.1)


def runs_all(run: Run) -> bool:
    now = run.now()
    assert now.status == "running", now.record.failure
    return bool(now.record.nodes) and all(node.status == "running" for node in now.record.nodes)


@pytest.mark.parametrize("runtime", ["docker", "local"])
def test_a_container_hears_the_run_that_it_joined_and_ends_with_it(
    client: DockerClient, runtime: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv(STATE_VARIABLE, str(tmp_path / "state"))
    config = tmp_path / "session.yaml"
    config.write_text(f"name: session\nrun: {{runtime: {runtime}, simulations: 1}}\n")
    session = begin_run(config, overrides=(), output=tmp_path / "none", kind="session")
    try:
        until(lambda: runs_all(session))
        command = ("ros", "topic", "echo", "/sim_0/clock")
        spec = ContainerSpec(default_tag(), command, NodeContainerConfig(memory="512m"))
        ear = begin_container(spec, run="ear-1", origin=Origin("ear", joins=session.id), urdf=None)
        heard = ear.record.logs / "container.log"
        until(lambda: heard.is_file() and "nanosec:" in heard.read_text())
        assert runs_all(ear)
    finally:
        control.down(session)
    until(lambda: ear.now().status == "ended")
    assert (ear.now().record.exit_code, ear.now().record.failure) == (0, None)
    for run in (session.id, ear.id):
        filters = {"label": f"{RUN_LABEL}={run}"}
        assert client.containers.list(all=True, filters=filters) == []
        assert client.networks.list(filters=filters) == []
        assert client.volumes.list(filters=filters) == []
