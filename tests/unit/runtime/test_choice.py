from collections.abc import Callable
from pathlib import Path
from unittest.mock import Mock

import pytest

from throwcollect.config.run import RunConfig
from throwcollect.config.schema import Config
from throwcollect.errors import WorkerError
from throwcollect.runtime import choice
from throwcollect.runtime.image import default_tag


@pytest.fixture
def choose() -> Callable[[str], tuple[str, list[str]]]:
    def choose(runtime: str) -> tuple[str, list[str]]:
        said: list[str] = []
        return choice.choose(Config(run=RunConfig(runtime=runtime)), say=said.append), said

    return choose


@pytest.fixture
def no_engine(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("DOCKER_HOST", f"unix://{tmp_path}/nothing.sock")


@pytest.fixture
def engine(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(choice, "connect", lambda **_: Mock())


def lacks_image(*_: object, **__: object) -> None:
    raise WorkerError("the image is not here and cannot be built")


def test_without_an_engine_auto_takes_processes_and_says_why(choose, no_engine, tmp_path: Path) -> None:
    assert choose("auto") == (
        "local",
        [
            f"runtime: local processes (auto, as no Docker engine answers at unix://{tmp_path}/nothing.sock: "
            "No such file or directory)"
        ],
    )


def test_containers_that_are_asked_for_and_cannot_be_had_are_an_error(choose, no_engine) -> None:
    with pytest.raises(WorkerError, match="no Docker engine answers") as caught:
        choose("docker")
    assert caught.value.exit_code == 3
    assert caught.value.hint


@pytest.mark.parametrize(("runtime", "note"), [("auto", " (auto)"), ("docker", "")])
def test_where_engine_and_image_are_there_containers_are_taken(
    choose, engine, monkeypatch: pytest.MonkeyPatch, runtime: str, note: str
) -> None:
    monkeypatch.setattr(choice, "ensure", lambda *_, **__: None)
    assert choose(runtime) == ("docker", [f"runtime: Docker containers of {default_tag()}{note}"])


def test_an_image_that_cannot_be_had_counts_like_no_engine(choose, engine, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(choice, "ensure", lacks_image)
    assert choose("auto") == (
        "local",
        ["runtime: local processes (auto, as the image is not here and cannot be built)"],
    )
    with pytest.raises(WorkerError, match="cannot be built"):
        choose("docker")


def test_processes_need_no_engine(choose, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(choice, "connect", lacks_image)
    assert choose("local") == ("local", ["runtime: local processes"])
