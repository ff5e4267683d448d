"""The choice of the runtime of a run, and of its middleware."""

from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from unittest.mock import Mock

import pytest
from docker.client import DockerClient
from tests.unit.collect.coordinator.listener import Listener

from throwcollect.collect.runtimes.docker import docker_engine as docker_engine
from throwcollect.collect.runtimes.docker import docker_engine as docker_image
from throwcollect.collect.runtimes.docker.docker_engine import default_tag
from throwcollect.collect.runtimes.image_sources import SOURCES_LABEL
from throwcollect.collect.runtimes.runtime import choose as choose_runtime
from throwcollect.config.run import ContainersConfig, RunConfig
from throwcollect.config.schema import Config
from throwcollect.errors import WorkerError
from throwcollect.ros.middleware import Middleware


@pytest.fixture
def choose() -> Callable[..., tuple[str, list[str]]]:
    """Chooses the runtime and returns what was printed; warnings begin with an exclamation mark."""

    def choose(runtime: str, image: str | None = None) -> tuple[str, list[str]]:
        listener = Listener()
        config = Config(run=RunConfig(runtime=runtime), containers=ContainersConfig(image=image))
        name, middleware = choose_runtime(config, listener)
        assert middleware == Middleware()
        return name, [*(f"! {line}" for line in listener.warnings), *listener.said]

    return choose


@pytest.fixture(autouse=True)
def socket_is_there(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("DOCKER_HOST", f"unix://{tmp_path}")


@pytest.fixture
def no_engine(socket_is_there, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("DOCKER_HOST", f"unix://{tmp_path}/nothing.sock")


@pytest.fixture
def engine(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(docker_engine, "connect", lambda **_: Mock())
    monkeypatch.setattr(docker_image, "ensure", lambda *_, **__: SimpleNamespace(labels={}))


@pytest.fixture
def outdated(engine, monkeypatch: pytest.MonkeyPatch) -> None:
    """An engine whose images are all outdated."""
    labels = {SOURCES_LABEL: "0" * 64}
    monkeypatch.setattr(docker_image, "ensure", lambda *_, **__: SimpleNamespace(labels=labels))


def lacks_image(*_: object, **__: object) -> None:
    raise WorkerError("the image is not here")


def test_auto_chooses_processes_without_a_docker_engine_and_says_why(choose, no_engine, tmp_path: Path) -> None:
    assert choose("auto") == (
        "local",
        [
            f"runtime: local processes (auto, as no Docker engine answers at unix://{tmp_path}/nothing.sock: "
            "No such file or directory)"
        ],
    )


@pytest.mark.parametrize(("runtime", "note"), [("auto", " (auto)"), ("docker", "")])
def test_containers_are_chosen_if_engine_and_image_are_there(choose, engine, runtime: str, note: str) -> None:
    assert choose(runtime) == ("docker", [f"runtime: Docker containers of {default_tag()}{note}"])


def test_requested_processes_need_no_docker_engine(choose, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(docker_engine, "connect", lacks_image)
    assert choose("local") == ("local", ["runtime: local processes"])


def test_an_outdated_default_image_is_not_used(choose, outdated) -> None:
    problem = f"the image {default_tag()} was made from other sources than these; make image builds it anew"
    assert choose("auto") == ("local", [f"runtime: local processes (auto, as {problem})"])
    with pytest.raises(WorkerError, match=problem):
        choose("docker")


FAST_DDS = Middleware("rclpy", "rmw_fastrtps_cpp")
ZENOH = Middleware("rclpy", "rmw_zenoh_cpp")


@pytest.mark.parametrize(
    ("launcher", "rmw", "ros", "expected"),
    [
        (Middleware(), None, "auto", Middleware()),
        (FAST_DDS, None, "auto", Middleware()),
        (FAST_DDS, "rmw_fastrtps_cpp", "auto", FAST_DDS),
        # A launcher without rclpy cannot join nodes on Fast DDS, but those on Zenoh.
        (Middleware(), "rmw_fastrtps_cpp", "auto", Middleware()),
        (Middleware(), "rmw_zenoh_cpp", "auto", ZENOH),
        (Middleware(), "rmw_zenoh_cpp", "embedded", Middleware()),
    ],
)
def test_containers_use_middleware_of_their_image_that_the_launcher_can_join(
    engine, monkeypatch: pytest.MonkeyPatch, launcher: Middleware, rmw: str | None, ros: str, expected: Middleware
) -> None:
    labels = {} if rmw is None else {docker_image.RMW_LABEL: rmw}
    monkeypatch.setattr(docker_image, "ensure", lambda *_, **__: SimpleNamespace(labels=labels))
    monkeypatch.setattr("throwcollect.collect.runtimes.runtime.choose_middleware", lambda _: launcher)
    listener = Listener()
    _, found = choose_runtime(Config(run=RunConfig(runtime="docker", ros=ros)), listener)
    assert found == expected
    assert ("on genuine rclpy" in listener.said[0]) == (expected.backend == "rclpy")


@pytest.mark.parametrize("host", ["tcp://192.0.2.7:2375", "ssh://lab"])
def test_an_engine_on_another_machine_is_not_used(choose, monkeypatch: pytest.MonkeyPatch, host: str) -> None:
    monkeypatch.setenv("DOCKER_HOST", host)
    monkeypatch.setattr(DockerClient, "from_env", lambda **_: Mock(info=lambda: {"Name": "lab"}))
    problem = f"the Docker engine at {host} is on another machine, lab, without directories of this one"
    assert choose("auto") == ("local", [f"runtime: local processes (auto, as {problem})"])
    with pytest.raises(WorkerError, match=problem) as caught:
        choose("docker")
    assert caught.value.hint == "run throwcollect on lab, or use processes: --runtime local"
