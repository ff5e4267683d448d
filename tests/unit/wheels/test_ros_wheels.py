"""The directory of wheels for the extra `ros`."""

import sys
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


def test_the_requirements_leave_out_the_interfaces_that_are_built(wheels: ModuleType) -> None:
    assert [name.partition("=")[0] for name in wheels.requirements()] == [
        "ros-jazzy-rclpy[fastrtps]",
        "ros-jazzy-common-interfaces",
    ]
