"""Runs that are one container of the catalogue, on a fake Docker engine."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import suppress
from pathlib import Path

import pytest
from tests.unit.collect.runtimes.docker.engine import Engine, engine_at

from throwcollect.collect.coordinator.reporter import SILENT
from throwcollect.collect.runs.component_container import launch_container
from throwcollect.collect.runs.control import down
from throwcollect.collect.runs.records import Records
from throwcollect.collect.runs.run import Run
from throwcollect.collect.runtimes.docker import component, containers
from throwcollect.collect.runtimes.docker.component import find_join_options
from throwcollect.collect.runtimes.docker.container_options import JOINED_LABEL, NODE_LABEL, RUN_LABEL
from throwcollect.collect.runtimes.run_record import Kind, Origin, RunRecord
from throwcollect.config.run import ContainerSpec, NodeContainerConfig
from throwcollect.errors import WorkerError
from throwcollect.ros.connection import Connection
from throwcollect.run_key import RunKey
from throwcollect.state_directory import STATE_VARIABLE

SPEC = ContainerSpec("nodes", ("listen",), NodeContainerConfig())


@pytest.fixture(autouse=True)
def engine(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Engine]:
    monkeypatch.setenv("DOCKER_HOST", f"unix://{tmp_path}/engine.sock")
    monkeypatch.setenv(STATE_VARIABLE, str(tmp_path / "state"))
    monkeypatch.setattr(containers, "_POLL_S", 0.05)
    monkeypatch.setattr(component, "_OVER_S", 0.5)
    with engine_at(tmp_path / "engine.sock") as engine:
        yield engine


def remember(name: str, kind: Kind, runtime: str, *, joins: str | None = None) -> Run:
    run = Records().new(name, run=name)
    directory = run.files / "data"
    directory.mkdir()
    origin = Origin(name, joins=joins)
    run.write(run.begin(name, directory, runtime=runtime, kind=kind, origin=origin, endpoint="tls/127.0.0.1:7447"))
    return run


@pytest.fixture
def session() -> Iterator[Run]:
    """A run of processes that could be joined."""
    run = remember("talos", "session", "local")
    yield run
    run.close()


def launch(engine: Engine, each_look: Callable[[], bool], joins: str | None = None) -> RunRecord:
    """The record of a container that runs until it is told to end."""
    run = remember("ear-1", "container", "docker", joins=joins)
    with suppress(WorkerError):
        launch_container(run, SPEC, reporter=SILENT, interruptions=lambda: int(bool(engine.running()) and each_look()))
    return Records().get("ear-1").record


def test_a_container_is_in_the_record_while_it_runs_and_removed_at_the_end(engine: Engine) -> None:
    seen: list[tuple[str, str]] = []

    def look() -> bool:
        (container,) = engine.containers.values()
        labels = container["Config"]["Labels"]
        assert (labels[RUN_LABEL], labels[NODE_LABEL]) == ("ear-1", "container")
        nodes = Records().get("ear-1").record.nodes
        seen.extend((node.name, node.status) for node in nodes)
        return ("container", "running") in seen

    record = launch(engine, look)
    assert seen[-1] == ("container", "running")
    assert (record.exit_code, record.nodes, record.left) == (0, (), False)
    assert engine.names() == []


def test_the_exit_code_of_a_container_that_has_ended_is_in_the_record(engine: Engine) -> None:
    def end() -> bool:
        engine.end("throwcollect-ear-1-container", 7)
        return False

    record = launch(engine, end)
    assert record.exit_code == WorkerError.exit_code
    assert record.failure is not None
    assert record.failure.message == "the container stopped: exit code 7"
    assert engine.names() == []


def test_a_container_ends_with_the_run_that_it_has_joined(engine: Engine, session: Run) -> None:
    def end() -> bool:
        (container,) = engine.containers.values()
        assert container["Config"]["Labels"][JOINED_LABEL] == "talos"
        session.close()
        return False

    record = launch(engine, end, "talos")
    assert (record.exit_code, record.failure) == (0, None)
    assert engine.names() == []


def test_down_removes_the_container_of_a_launcher_that_died(engine: Engine) -> None:
    run = remember("ear-1", "container", "docker")
    engine.create("throwcollect-ear-1-container", {RUN_LABEL: "ear-1", NODE_LABEL: "container"})
    run.close()
    assert down(Records().get("ear-1")) == ["throwcollect-ear-1-container"]
    assert engine.names() == []


def test_a_container_joins_a_run_of_containers_over_the_network_of_the_run(tmp_path: Path) -> None:
    connection = Connection("tls/172.18.0.2:7447", RunKey(tmp_path), 7)
    options = find_join_options("talos", "docker", connection, SPEC)
    assert (options.network, options.key) == ("throwcollect-talos", f"{tmp_path}:/key:ro,z")
    assert "tls/router:7447" in options.environment["ZENOH_CONFIG_OVERRIDE"]
    assert (options.environment["ROS_DOMAIN_ID"], options.environment["RMW_IMPLEMENTATION"]) == ("7", "rmw_zenoh_cpp")
    options = find_join_options("talos", "local", connection, SPEC)
    assert (options.network, options.key) == (None, f"{tmp_path}:/key:ro,z")
    assert "tls/172.18.0.2:7447" in options.environment["ZENOH_CONFIG_OVERRIDE"]
