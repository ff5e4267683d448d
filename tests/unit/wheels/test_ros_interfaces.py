"""The project that builds the wheel of interfaces, as far as it goes without ROS' generators."""

import re
import sys
import tarfile
from pathlib import Path

import pytest

if sys.version_info < (3, 11):
    pytest.skip("the wheel is for Python 3.11", allow_module_level=True)

import tomllib

ROOT = Path(__file__).parents[3]
PROJECT = ROOT / "packaging" / "ros_interfaces"
DEFINITIONS = ROOT / "src" / "rclzenoh" / "interfaces" / "definitions"


@pytest.fixture(autouse=True)
def _backend(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(str(PROJECT))
    monkeypatch.setattr("sys.dont_write_bytecode", True)
    monkeypatch.delenv("SOURCE_DATE_EPOCH", raising=False)


def pins(lines: list[str]) -> dict[str, str]:
    """Versions by name, of lines that pin one."""
    found = (re.fullmatch(r"([\w-]+)(?:\[\w+\])?==([\w.]+)", line) for line in lines)
    return {each[1]: each[2] for each in found if each}


def test_all_ros_packages_are_pinned_to_the_same_versions() -> None:
    tried = pins((ROOT / "packaging" / "ros_constraints.txt").read_text().splitlines())
    document = tomllib.loads((PROJECT / "pyproject.toml").read_text())
    ours = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["optional-dependencies"]["ros"]
    assert len(pins(ours)) == len(ours)
    assert pins(ours).pop("throwcollect-ros-interfaces") == document["project"]["version"]
    wanted = [*document["project"]["dependencies"], *document["tool"]["ros-interfaces"]["generators"], *ours]
    of_ros = {name: version for name, version in pins(wanted).items() if name.startswith("ros-")}
    assert len(of_ros) == len([name for name in wanted if name.startswith("ros-")])
    assert of_ros == {name: tried[name] for name in of_ros}


def test_the_built_packages_hold_exactly_the_definitions_of_throwcollect() -> None:
    from builder.project import PROJECT as BUILT

    names = [package.name for package in BUILT.packages]
    assert names == ["control_msgs", "controller_manager_msgs", "simulation_interfaces", "tf2_msgs"]
    for package in BUILT.packages:
        on_disk = {path.relative_to(DEFINITIONS / package.name) for path in (DEFINITIONS / package.name).glob("*/*")}
        assert set(package.files) == on_disk
        readme = (PROJECT / "README.md").read_text()
        assert re.search(rf"\[{package.name}\]\({package.source}\).*{package.license}", readme)


def test_the_source_archive_carries_definitions_and_licences_and_is_the_same_twice(tmp_path: Path) -> None:
    from builder import build_sdist

    contents = []
    for name in ("first", "second"):
        (tmp_path / name).mkdir()
        contents.append((tmp_path / name / build_sdist(str(tmp_path / name))).read_bytes())
    assert contents[0] == contents[1]
    with tarfile.open(tmp_path / "first" / "throwcollect_ros_interfaces-0.1.0.tar.gz") as archive:
        names = {name.partition("/")[2] for name in archive.getnames()}
    assert {"PKG-INFO", "pyproject.toml", "LICENSE", "LICENSE.BSD", "builder/__init__.py"} <= names
    assert "definitions/tf2_msgs/msg/TFMessage.msg" in names
    assert "definitions/std_srvs/srv/Trigger.srv" not in names
