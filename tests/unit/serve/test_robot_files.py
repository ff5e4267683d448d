import re
from collections.abc import Iterator
from dataclasses import replace
from importlib.metadata import EntryPoint, EntryPoints
from unittest.mock import Mock

import pytest

from throwcollect import members
from throwcollect.robots.talos import TALOS
from throwcollect.serve import robot_files


def forget() -> None:
    for cached in (
        members._find_members,
        members.find_broken,
        robot_files._read_descriptions,
        robot_files._find_packages,
    ):
        cached.cache_clear()


WITHOUT_FILES = replace(TALOS, name="without_files", urdf="/nowhere/robot.urdf")


@pytest.fixture
def _broken_robots(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """Another package has a robot that cannot be loaded, and one whose description is missing."""
    entries = [("broken", "not_there:ROBOT"), ("without_files", f"{__name__}:WITHOUT_FILES")]
    points = {"throwcollect.robots": EntryPoints([EntryPoint(*entry, "") for entry in entries])}
    installed = Mock(select=lambda group: points.get(group, EntryPoints()))
    monkeypatch.setattr(members, "entry_points", lambda group=None: installed.select(group) if group else installed)
    forget()
    yield
    monkeypatch.undo()
    forget()


@pytest.mark.usefixtures("_broken_robots")
def test_meshes_of_a_robot_are_found_although_others_are_broken() -> None:
    assert set(members.find_broken("robots")) == {"broken"}
    assert members.usable_names("robots") == (*members._OWN["robots"], "without_files")
    package, path = re.findall(r"package://([^/\"]+)/([^\"]+)", TALOS.urdf_path.read_text())[0]
    assert robot_files.find_mesh(package, path) == (TALOS.directory / package / path).resolve()
