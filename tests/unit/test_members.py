import os
import subprocess
import sys
from fractions import Fraction
from importlib.metadata import EntryPoint, EntryPoints
from pathlib import Path

import pytest

from throwcollect import members
from throwcollect.engines.bullet.bullet_engine import BulletEngine
from throwcollect.members import load_member, names_of

PLUGINS = Path(__file__).parents[1] / "plugins"
ARM = """\
robot: {name: planar_arm}
task:
  start: {shoulder_joint: 0.0, elbow_joint: 0.0}
  end: {shoulder_joint: 1.4, elbow_joint: 0.3}
  duration_s: 0.5
"""


def with_plugins(*arguments: str) -> subprocess.CompletedProcess[str]:
    """Run throwcollect where the package of `tests/plugins` is installed."""
    path = os.pathsep.join([str(PLUGINS), os.environ.get("PYTHONPATH", "")])
    return subprocess.run(
        [sys.executable, "-m", "throwcollect", *arguments],
        env={**os.environ, "PYTHONPATH": path},
        capture_output=True,
        text=True,
        check=False,
    )


@pytest.mark.parametrize("family", ["robots", "tools", "engines", "tasks", "runtimes"])
def test_every_member_can_be_loaded(family: str) -> None:
    assert names_of(family)
    for name in names_of(family):
        assert load_member(family, name) is not None


def test_a_member_of_another_package_is_found_and_takes_the_place_of_none_of_ours(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    group = "throwcollect.engines"
    points = EntryPoints([EntryPoint("free_fall", "fractions:Fraction", group), EntryPoint("bullet", "x:Other", group)])
    monkeypatch.setattr(members, "entry_points", lambda **_: points)
    caches = (members._table, load_member)
    for cached in caches:
        cached.cache_clear()
    assert names_of("engines") == ("bullet", "mujoco", "ballistic", "free_fall")
    assert load_member("engines", "free_fall") is Fraction
    assert load_member("engines", "bullet") is BulletEngine
    for cached in caches:
        cached.cache_clear()


def test_a_member_that_there_is_not_is_an_error() -> None:
    with pytest.raises(KeyError, match="hand"):
        load_member("robots", "hand")


def test_a_configuration_may_name_a_robot_of_another_package(tmp_path: Path) -> None:
    path = tmp_path / "arm.yaml"
    path.write_text(ARM)
    done = with_plugins("config", str(path))
    assert done.returncode == 0, done.stderr
    assert "name: planar_arm" in done.stdout


def test_joints_are_those_of_the_robot_that_the_configuration_names(tmp_path: Path) -> None:
    path = tmp_path / "arm.yaml"
    path.write_text(ARM.replace("elbow_joint: 0.3", "elbow: 0.3"))
    done = with_plugins("config", str(path))
    assert done.returncode == 2
    assert f"{path}:4: task.end.elbow: the planar arm has no joint 'elbow'; did you mean 'elbow_joint'?" in done.stderr


def test_with_a_robot_that_there_is_not_its_joints_are_not_complained_of(tmp_path: Path) -> None:
    path = tmp_path / "arm.yaml"
    path.write_text(ARM.replace("planar_arm", "planar_hand"))
    done = with_plugins("config", str(path))
    assert done.returncode == 2
    assert "robot.name: should be 'talos' or 'planar_arm', got 'planar_hand'; did you mean 'planar_arm'?" in done.stderr
    assert "joint" not in done.stderr
