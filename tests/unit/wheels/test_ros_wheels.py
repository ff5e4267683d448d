"""The directory of wheels for the extra `ros`."""

import subprocess
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
    commands: list[list[str]] = []

    def run(command: list[str], **_: object) -> None:
        commands.append(command)
        (tmp_path / "new.whl").touch()

    monkeypatch.setattr(wheels.subprocess, "run", run)
    (tmp_path / "old.whl").touch()
    assert wheels.fill(tmp_path)
    assert [path.name for path in tmp_path.glob("*.whl")] == ["new.whl"]
    assert not wheels.fill(tmp_path)
    (command,) = commands
    assert command[:4] == [sys.executable, "-m", "pip", "wheel"]
    assert command[-3:] == [str(wheels.INTERFACES), *wheels.requirements()]
    changed = tmp_path / "definitions"
    monkeypatch.setattr(wheels, "ROOT", Path("/"))
    monkeypatch.setattr(wheels, "DEFINITIONS", changed)
    monkeypatch.setattr(wheels, "requirements", lambda: ["ros"])
    changed.mkdir()
    assert wheels.fill(tmp_path)
    (changed / "New.msg").touch()
    assert wheels.fill(tmp_path)
    assert not wheels.fill(tmp_path)


def test_a_collection_that_fails_is_begun_anew_next_time(
    wheels: ModuleType, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail(*_: object, **__: object) -> None:
        raise subprocess.CalledProcessError(3, "pip")

    monkeypatch.setattr(wheels.subprocess, "run", fail)
    for _ in range(2):
        with pytest.raises(SystemExit) as ended:
            wheels.main(tmp_path)
        assert ended.value.code == 3


def test_the_interfaces_are_built_and_not_asked_of_an_index(wheels: ModuleType) -> None:
    assert [name.partition("=")[0] for name in wheels.requirements()] == [
        "ros-jazzy-rclpy[fastrtps]",
        "ros-jazzy-common-interfaces",
    ]
