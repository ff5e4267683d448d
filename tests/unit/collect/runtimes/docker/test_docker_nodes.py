"""What happens when a Docker engine answers late, or not at all."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator
from concurrent.futures import Future
from pathlib import Path
from typing import Any

import pytest
from tests.unit.collect.runtimes.docker.engine import Engine, engine_at

from throwcollect.collect.runtimes.docker import containers
from throwcollect.collect.runtimes.docker import docker_nodes as module
from throwcollect.collect.runtimes.docker.containers import Container
from throwcollect.collect.runtimes.docker.docker_nodes import DockerNodes
from throwcollect.collect.runtimes.nodes import NodeExit, NodeRole, NodeSpec
from throwcollect.collect.runtimes.run_record import RunRecord
from throwcollect.config.schema import Config
from throwcollect.errors import WorkerError
from throwcollect.ros.middleware import Middleware
from throwcollect.run_key import RunKey

CONFIG = Config.model_validate({"containers": {"image": "image"}})


@pytest.fixture
def engine(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Engine]:
    path = tmp_path / "engine.sock"
    monkeypatch.setenv("DOCKER_HOST", f"unix://{path}")
    # All times are about a hundredth of the real ones.
    monkeypatch.setattr(containers, "_POLL_S", 0.02)
    monkeypatch.setattr(containers, "_WARN_S", 0.2)
    monkeypatch.setattr(containers, "SILENCE_S", 1.0)
    monkeypatch.setattr(module, "ANSWER_S", 0.5)
    with engine_at(path) as engine:
        yield engine


@pytest.fixture
def warnings() -> list[str]:
    return []


@pytest.fixture
def make(engine: Engine, tmp_path: Path, warnings: list[str]) -> Iterator[Callable[[], DockerNodes]]:
    made: list[DockerNodes] = []

    def make() -> DockerNodes:
        directory = tmp_path / "my data"
        key = RunKey(tmp_path / "key")
        key.create()
        made.append(
            DockerNodes(
                RunRecord("run-1a2b", directory, tmp_path / "logs", 1, Middleware(), key),
                CONFIG,
                warn=warnings.append,
            )
        )
        made[-1].open()
        return made[-1]

    yield make
    engine.answer_all()
    for runtime in made:
        runtime.close()


def until(condition: Callable[[], Any], *, runtime: DockerNodes | None = None) -> list[NodeExit]:
    """Wait for a condition, and meanwhile ask for ended nodes as a supervisor does."""
    exits: list[NodeExit] = []
    deadline = time.monotonic() + 60
    while not condition():
        assert time.monotonic() < deadline, "did not happen"
        exits += runtime.exits() if runtime else []
        time.sleep(0.01)
    return exits


def test_a_slow_engine_is_waited_for_with_a_warning(
    engine: Engine, make: Callable[[], DockerNodes], warnings: list[str]
) -> None:
    runtime = make()
    engine.withheld = "."
    until(lambda: warnings, runtime=runtime)
    assert warnings == ["the Docker engine has not answered for 0 s; waiting"]
    engine.answer_all()
    until(lambda: len(warnings) > 1, runtime=runtime)
    assert warnings[1:] == ["the Docker engine answers again"]
    runtime.close()
    assert runtime.cleared


def test_giving_up_a_silent_engine_names_left_containers_and_how_to_go_on(
    engine: Engine, make: Callable[[], DockerNodes], tmp_path: Path
) -> None:
    runtime = make()
    runtime.start(NodeSpec("sim_0", ("sim",), NodeRole.EXPENDABLE))
    until(lambda: runtime.handle("sim_0"), runtime=runtime)
    engine.withheld = "."
    with pytest.raises(WorkerError, match=r"has not answered for [12] s") as caught:
        until(lambda: False, runtime=runtime)
    assert caught.value.evidence == "no answer in time\ncontainers that may run on: throwcollect-run-1a2b-sim_0"
    resume = f"throwcollect resume '{tmp_path}/my data'"
    assert caught.value.hint == (
        f"once it answers, throwcollect down --run run-1a2b ends them, and {resume} goes on without them"
    )
    runtime.close()
    assert not runtime.cleared
    assert engine.names() == ["throwcollect-run-1a2b-sim_0"]


def test_a_container_that_is_created_late_is_removed_at_the_end(
    engine: Engine, make: Callable[[], DockerNodes]
) -> None:
    runtime = make()
    engine.withheld = "POST /containers/create"
    runtime.start(NodeSpec("sim_0", ("sim",), NodeRole.EXPENDABLE))
    until(lambda: engine.withheld in engine.asked)
    answering = threading.Timer(0.1, engine.answer_all)
    answering.start()
    runtime.close()
    answering.join()
    assert engine.names() == []
    assert runtime.cleared


def test_the_output_of_a_container_is_in_the_log_once_and_before_its_end_is_known(
    engine: Engine, make: Callable[[], DockerNodes], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(containers, "_TAIL_LINES", 3)
    runtime = make()
    runtime.start(NodeSpec("sim_0", ("sim",), NodeRole.EXPENDABLE))
    name = "throwcollect-run-1a2b-sim_0"
    log = runtime.logs.path("sim_0")
    engine.printed[name] = ["one", "sim_0 is ready"]
    until(lambda: runtime.logs.said_ready("sim_0"), runtime=runtime)
    # More lines than the engine is asked for at first.
    engine.printed[name] += [str(number) for number in range(9)]
    until(lambda: log.read_text().endswith("8\n"), runtime=runtime)
    engine.printed[name].append("the end")
    engine.end(name, 3)
    (end,) = until(lambda: not runtime.running(), runtime=runtime)
    assert (end.code, end.log) == (3, log.read_text().strip())
    assert log.read_text().splitlines() == engine.printed[name]


@pytest.mark.parametrize(
    ("state", "memory", "words"),
    [
        (("exited", 0), None, "exit code 0"),
        (("exited", 137), "512m", "ended by SIGKILL"),
        (("exited", 137, True), "512m", "ran out of memory (limit 512m)"),
        (("removed",), None, "its container was removed"),
    ],
)
def test_the_end_of_a_container_is_described_by_its_signal_or_exit_code(
    state: tuple[Any, ...], memory: str | None, words: str
) -> None:
    container = Container("sim_0", Future(), *state)
    assert container.ended
    assert container.describe_end(memory) == words
