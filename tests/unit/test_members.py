import os
import subprocess
import sys
from collections.abc import Callable, Iterator
from importlib.metadata import EntryPoint, EntryPoints
from pathlib import Path

import pytest
from tests.e2e.collection import call_here
from tests.e2e.plugins import process_with_plugins

from throwcollect import members
from throwcollect.engines.ballistic.ballistic_engine import BallisticEngine
from throwcollect.engines.bullet.bullet_engine import BulletEngine
from throwcollect.errors import ConfigError, DatasetError, MemberError
from throwcollect.members import explain_failure, load_member, names_of

Say = Callable[..., subprocess.CompletedProcess[str]]
BALLISTIC = "throwcollect.engines.ballistic.ballistic_engine:BallisticEngine"
SPOON = "throwcollect.robots.tools.spoon.spoon_config:SpoonConfig"
ARM = """\
robot: {name: planar_arm}
task:
  start: {shoulder_joint: 0.0, elbow_joint: 0.0}
  end: {shoulder_joint: 1.4, elbow_joint: 0.3}
  duration_s: 0.5
"""


@pytest.fixture(scope="module")
def with_plugins() -> Iterator[Say]:
    """A function that calls throwcollect where the packages of `tests/plugins` are installed."""
    with process_with_plugins() as process:
        yield lambda *arguments: process.submit(call_here, *arguments).result()


@pytest.mark.parametrize("family", ["robots", "tools", "engines", "tasks", "runtimes", "exporters"])
def test_every_member_can_be_loaded(family: str) -> None:
    assert names_of(family)
    for name in names_of(family):
        assert load_member(family, name) is not None


def test_a_member_of_another_package_is_found_and_takes_the_place_of_none_of_ours(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    group = "throwcollect.engines"
    points = EntryPoints([EntryPoint("free_fall", BALLISTIC, group), EntryPoint("bullet", "x:Other", group)])
    monkeypatch.setattr(members, "entry_points", lambda **_: points)
    caches = (members._find_members, load_member)
    for cached in caches:
        cached.cache_clear()
    assert names_of("engines") == ("bullet", "mujoco", "ballistic", "free_fall")
    assert load_member("engines", "free_fall") is BallisticEngine
    assert load_member("engines", "bullet") is BulletEngine
    for cached in caches:
        cached.cache_clear()


def test_a_configuration_may_name_a_robot_of_another_package(with_plugins: Say, tmp_path: Path) -> None:
    path = tmp_path / "arm.yaml"
    path.write_text(ARM)
    done = with_plugins("config", str(path))
    assert done.returncode == 0, done.stderr
    assert "name: planar_arm" in done.stdout


def test_a_robot_without_postures_does_not_get_those_of_talos(with_plugins: Say, tmp_path: Path) -> None:
    path = tmp_path / "arm.yaml"
    path.write_text("trials: 4\nrobot: {name: planar_arm}\n")
    done = with_plugins("config", str(path))
    assert done.returncode == 2
    wants = (
        "missing, and the default has joints that the planar arm lacks; `throwcollect init --robot planar_arm` writes"
    )
    assert [line.partition(" writes")[0] + " writes" for line in done.stderr.splitlines()] == [
        f"throwcollect: {path}: task.start: {wants}",
        f"{path}: task.end: {wants}",
    ]


BROKEN = """
from throwcollect.config.task_config import TaskConfig

NUMBER = 3

def __getattr__(name):
    if name == "UNLICENSED":
        raise SystemExit(0)
    if name == "Aimless":
        return type("Aimless", (TaskConfig,), {"__module__": __name__})
    raise AttributeError(f"module 'broken' has no attribute {name!r}")
"""


def find_what_is_said(text: str, family: str, value: str, directory: Path, monkeypatch: pytest.MonkeyPatch) -> str:
    """Install the module ``broken`` with a member of the name ``mine``, and load the member."""
    (directory / "broken.py").write_text(text)
    install(directory, "somebodys", family, value)
    monkeypatch.syspath_prepend(directory)
    monkeypatch.delitem(sys.modules, "broken", raising=False)
    for cached in (members._find_members, load_member):
        cached.cache_clear()
    with pytest.raises(ConfigError) as caught:
        load_member(family, "mine")
    monkeypatch.undo()
    members._find_members.cache_clear()
    return str(caught.value)


@pytest.mark.parametrize(
    ("family", "value", "said"),
    [
        ("robots", "not_there:ARM", " cannot be loaded: ModuleNotFoundError: No module named 'not_there'"),
        ("engines", "broken:UNLICENSED", " cannot be loaded: SystemExit: 0"),
        ("engines", "broken:NUMBER", ": broken:NUMBER should be of throwcollect.engines.engine.Engine, is 3"),
        ("tools", SPOON, f": {SPOON} should have the name of its entry point, 'mine', has 'spoon'"),
    ],
)
def test_a_broken_member_is_an_error_that_names_its_package(
    family: str, value: str, said: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    found = find_what_is_said(BROKEN, family, value, tmp_path, monkeypatch)
    assert found.startswith(f"the {family[:-1]} mine of somebodys 1.0{said}")


def test_two_packages_with_a_member_of_one_name_are_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    install(tmp_path, "first", "engines", BALLISTIC)
    install(tmp_path, "second", "engines", "x:Other")
    monkeypatch.syspath_prepend(tmp_path)
    for cached in (members._find_members, load_member):
        cached.cache_clear()
    with pytest.raises(
        ConfigError, match=r"the engine mine of first 1\.0 and second 1\.0: only one package may use a name"
    ):
        load_member("engines", "mine")
    monkeypatch.undo()
    members._find_members.cache_clear()


def test_broken_members_stop_only_configurations_that_name_them(tmp_path: Path) -> None:
    for family in ("robots", "tools", "tasks"):
        install(tmp_path, f"broken_{family}", family, "not_there:Member")
    named = "trials: 3\ntask:\n  name: mine\n  speed: 1\ntool: {name: mine, size: 1}\n"
    (tmp_path / "named.yaml").write_text(named)
    commands = [["config", "named.yaml"], ["init", "--task", "mine"], ["init"], ["config", "throwcollect.yaml"]]
    path = os.pathsep.join([str(tmp_path), os.environ.get("PYTHONPATH", "")])
    done = [
        subprocess.run(
            [sys.executable, "-m", "throwcollect", *command],
            cwd=tmp_path,
            env={**os.environ, "PYTHONPATH": path},
            capture_output=True,
            text=True,
            check=False,
        )
        for command in commands
    ]
    assert [each.returncode for each in done] == [2, 2, 0, 0], done
    lines = sorted(done[0].stderr.removeprefix("throwcollect: ").splitlines())
    for line, (number, key) in zip(lines, [(3, "task"), (5, "tool")], strict=True):
        said = f"named.yaml:{number}: {key}.name: the {key} mine of broken_{key}s 1.0 cannot be loaded: ModuleNotFound"
        assert line.startswith(said)
    assert done[1].stderr.startswith("throwcollect: the task mine of broken_tasks 1.0 cannot be loaded: ModuleNotFound")


@pytest.mark.parametrize("debug", ["", "1"])
def test_an_exception_in_a_member_is_reported_as_a_fault_of_its_package(
    debug: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    install(tmp_path, "somebodys", "tasks", "some:Task")
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.setenv("THROWCOLLECT_DEBUG", debug)
    with pytest.raises(MemberError) as caught, explain_failure("tasks", "mine", "judge trial 3"):
        raise KeyError("elbow")
    assert caught.value.message == "the task mine of somebodys 1.0 cannot judge trial 3: KeyError: 'elbow'"
    assert ("Traceback" in capsys.readouterr().err) == bool(debug)


@pytest.mark.parametrize(
    ("name", "error"), [("throw", KeyError("elbow")), ("mine", DatasetError("torn")), ("mine", OSError(28, "full"))]
)
def test_faults_of_our_own_members_and_intended_errors_pass_unchanged(name: str, error: Exception) -> None:
    with pytest.raises(type(error)) as caught, explain_failure("tasks", name, "write it", passing=(OSError,)):
        raise error
    assert caught.value is error


def install(directory: Path, package: str, family: str, value: str) -> None:
    """Add the member `mine` of a package to a directory, as pip would."""
    about = directory / f"{package}-1.0.dist-info"
    about.mkdir()
    (about / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {package}\nVersion: 1.0\n")
    (about / "entry_points.txt").write_text(f"[throwcollect.{family}]\nmine = {value}\n")
