"""The directory of wheels for the extra `ros`."""

import subprocess
import sys
import threading
from concurrent.futures import ThreadPoolExecutor, wait
from pathlib import Path
from types import ModuleType

import pytest

ROOT = Path(__file__).parents[3]


@pytest.fixture
def wheels(monkeypatch: pytest.MonkeyPatch) -> ModuleType:
    monkeypatch.syspath_prepend(str(ROOT / "packaging"))
    import ros_wheels

    return ros_wheels


def test_wheels_are_collected_again_only_when_something_has_changed(
    wheels: ModuleType, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    directory = tmp_path / "wheels"
    commands: list[list[str]] = []

    def run(command: list[str], **_: object) -> None:
        commands.append(command)
        directory.mkdir()
        (directory / "new.whl").touch()

    monkeypatch.setattr(wheels.subprocess, "run", run)
    directory.mkdir()
    (directory / "old.whl").touch()
    assert wheels.fill(directory)
    assert [path.name for path in directory.glob("*.whl")] == ["new.whl"]
    assert not wheels.fill(directory)
    (command,) = commands
    assert command[:4] == [sys.executable, "-m", "pip", "wheel"]
    assert command[-3:] == [str(wheels.INTERFACES), *wheels.requirements()]
    changed = tmp_path / "definitions"
    monkeypatch.setattr(wheels, "ROOT", Path("/"))
    monkeypatch.setattr(wheels, "DEFINITIONS", changed)
    monkeypatch.setattr(wheels, "requirements", lambda: ["ros"])
    changed.mkdir()
    assert wheels.fill(directory)
    (changed / "New.msg").touch()
    assert wheels.fill(directory)
    assert not wheels.fill(directory)


def test_two_concurrent_callers_collect_the_wheels_once(
    wheels: ModuleType, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    directory = tmp_path / "wheels"
    begun, may_end = threading.Event(), threading.Event()

    def run(*_: object, **__: object) -> None:
        begun.set()
        assert may_end.wait(10)
        directory.mkdir()
        (directory / "new.whl").touch()

    monkeypatch.setattr(wheels.subprocess, "run", run)
    with ThreadPoolExecutor(2) as pool:
        first = pool.submit(wheels.fill, directory)
        assert begun.wait(10)
        second = pool.submit(wheels.fill, directory)
        assert wait([second], timeout=0.2).not_done
        may_end.set()
        assert (first.result(10), second.result(10)) == (True, False)


def test_a_failed_collection_of_wheels_is_tried_again(
    wheels: ModuleType, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail(*_: object, **__: object) -> None:
        raise subprocess.CalledProcessError(3, "pip")

    monkeypatch.setattr(wheels.subprocess, "run", fail)
    for _ in range(2):
        with pytest.raises(SystemExit) as ended:
            wheels.main(tmp_path)
        assert ended.value.code == 3


def test_the_requirements_leave_out_the_interfaces_that_are_built(wheels: ModuleType) -> None:
    assert [name.partition("=")[0] for name in wheels.requirements()] == [
        "ros-jazzy-rclpy[fastrtps]",
        "ros-jazzy-common-interfaces",
    ]


def test_help_prints_the_usage_and_makes_no_directory(tmp_path: Path) -> None:
    script = ROOT / "packaging" / "ros_wheels.py"
    said = subprocess.run(
        [sys.executable, script, "--help"], cwd=tmp_path, capture_output=True, text=True, timeout=60, check=False
    )
    assert said.stdout.startswith("usage: ros_wheels.py")
    assert list(tmp_path.iterdir()) == []
