from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from importlib.metadata import EntryPoint, EntryPoints
from pathlib import Path
from unittest.mock import Mock

import pytest

from throwcollect import members
from throwcollect.build import build_digest
from throwcollect.collect.runs.doctor import examine
from throwcollect.members import names_of
from throwcollect.robots.talos import TALOS

PLUGINS = Path(__file__).parents[3] / "plugins"


def test_doctor_finds_no_problem_on_a_machine_that_runs_the_tests(tmp_path: Path) -> None:
    checks = {check.name: check for check in examine(tmp_path)}
    assert list(checks) == [
        "python",
        "extras",
        "cores",
        "pybullet",
        "mujoco",
        "robot",
        *(f"robot {name}" for name in names_of("robots")[1:]),
        "rclpy",
        "embedded",
        "docker",
        "state",
        "disk",
    ]
    assert [check for check in checks.values() if check.status == "problem"] == []
    assert str(tmp_path) in checks["disk"].finding
    # Two machines whose builds differ cannot simulate for one run.
    for package, engine in (("pybullet", "bullet"), ("mujoco", "mujoco")):
        assert f", build {build_digest(engine)[:10]}" in checks[package].finding


def test_doctor_lists_installed_and_missing_extras(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("throwcollect.collect.runs.doctor.is_installed", lambda package: package != "onnx")
    monkeypatch.setattr("throwcollect.collect.runs.doctor.has_wheel", lambda _: True)
    (finding,) = (check.finding for check in examine(tmp_path) if check.name == "extras")
    there = "collect, docker, export, gym, mujoco, pandas, report, serve, video"
    assert finding == f"{there}, without onnx (try: pip install 'throwcollect[onnx]')"


def lack_disk() -> Path:
    raise OSError("the disk is gone")


LOST_ARM = replace(TALOS, name="lost", share=lack_disk)


@pytest.fixture
def install(monkeypatch: pytest.MonkeyPatch) -> Iterator[Callable[[str, Mapping[str, str]], None]]:
    """Adds members of another package to a family, by name, until the test ends."""
    points: dict[str, EntryPoints] = {}
    caches = (members._find_members, members.find_broken)

    def install(family: str, places: Mapping[str, str]) -> None:
        group = f"throwcollect.{family}"
        points[group] = EntryPoints(EntryPoint(name, place, group) for name, place in places.items())
        for cached in caches:
            cached.cache_clear()

    def select(group: str) -> EntryPoints:
        return points.get(group, EntryPoints())

    monkeypatch.setattr(members, "entry_points", lambda group=None: select(group) if group else Mock(select=select))
    yield install
    monkeypatch.undo()
    for cached in caches:
        cached.cache_clear()


def test_doctor_examines_robots_of_other_packages_and_notes_failures(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, install: Callable[[str, Mapping[str, str]], None]
) -> None:
    monkeypatch.syspath_prepend(PLUGINS)
    places = {"planar_arm": "planar_arm.robot:PLANAR_ARM", "absent": "not_there:ARM", "lost": f"{__name__}:LOST_ARM"}
    install("robots", places)
    checks = {check.name: check for check in examine(tmp_path)}
    found = {name: (checks[f"robot {name}"].status, checks[f"robot {name}"].finding) for name in places}
    assert found["planar_arm"] == ("ok", f"the planar arm, {PLUGINS / 'planar_arm' / 'planar_arm.urdf'}")
    assert found["absent"][0] == found["lost"][0] == "note"
    assert "the robot absent of an unknown package cannot be loaded: ModuleNotFoundError" in found["absent"][1]
    assert "the robot lost of an unknown package cannot find its files: OSError: the disk" in found["lost"][1]
    assert (checks["robot"].status, checks["robot"].finding.partition(" of ")[0]) == ("ok", "Talos")
