"""Interfaces that genuine rclpy loads, against those of the embedded backend."""

import json
import re
import sys
from importlib import import_module
from importlib.metadata import PackageNotFoundError, distribution
from pathlib import Path

import pytest

from rclzenoh import interfaces
from rclzenoh.interfaces import type_hash
from rclzenoh.interfaces.typed_names import ACTIONS, MESSAGES, SERVICES

ROOT = Path(__file__).parents[2]
DEFINITIONS = Path(interfaces.__file__).parent / "definitions"
BUILT = ("control_msgs", "controller_manager_msgs", "simulation_interfaces", "tf2_msgs")
NAME = re.compile(r"""["']([a-z0-9_]+/(?:msg|srv|action)/[A-Z]\w+)["']""")


def find_used() -> set[str]:
    """Every interface that is named in the sources, or that they import."""
    sources = (ROOT / "src" / "throwcollect").rglob("*.py")
    named = {name for path in sources for name in NAME.findall(path.read_text(encoding="utf-8"))}
    return named.union(MESSAGES.values(), SERVICES.values(), ACTIONS.values())


def find_defined() -> set[str]:
    """Every interface that the wheel is built from."""
    paths = (path for package in BUILT for path in (DEFINITIONS / package).glob("*/*"))
    return {path.relative_to(DEFINITIONS).with_suffix("").as_posix() for path in paths}


def genuine_hash(name: str) -> str:
    """Hash that the generators of ROS 2 have computed, as it is installed with the interface."""
    text = Path(sys.prefix, "share", f"{name}.json").read_text(encoding="utf-8")
    return {each["type_name"]: each["hash_string"] for each in json.loads(text)["type_hashes"]}[name]


@pytest.fixture(scope="session")
def _wheels() -> None:
    try:
        distribution("throwcollect-ros-interfaces")
    except PackageNotFoundError:
        pytest.skip("interfaces are not those of the wheel")


@pytest.mark.usefixtures("_wheels")
@pytest.mark.parametrize("name", sorted(find_used() | find_defined()))
def test_type_hashes_of_both_backends_are_equal(name):
    assert type_hash(name) == genuine_hash(name)


@pytest.mark.usefixtures("_wheels")
def test_the_wheel_holds_exactly_the_defined_interfaces():
    files = [file.as_posix() for file in distribution("throwcollect-ros-interfaces").files or ()]
    found = [file for file in files if file.endswith((".msg", ".srv", ".action"))]
    assert {file.partition("share/")[2].rpartition(".")[0] for file in found} == find_defined()


@pytest.mark.parametrize("name", sorted(find_used() | find_defined()))
def test_every_used_interface_loads_its_type_support(name):
    package, kind, short = name.split("/")
    interface = getattr(import_module(f"{package}.{kind}"), short)
    type(interface).__import_type_support__()
    assert type(interface)._TYPE_SUPPORT is not None


@pytest.mark.parametrize(
    ("get", "wrong"),
    [
        ("get_message", "std_msgs/msg/Strin"),
        ("get_service", "std_msgs/srv/String"),
    ],
)
def test_a_name_of_no_interface_is_refused_by_both_backends(get, wrong):
    from throwcollect.ros import genuine

    with pytest.raises(ValueError, match=re.escape(repr(wrong))):
        getattr(genuine, get)(wrong)
    with pytest.raises(ValueError, match=re.escape(repr(wrong))):
        getattr(interfaces, get)(wrong)


def test_the_genuine_backend_returns_the_classes_of_ros():
    from throwcollect.ros import genuine

    follow = import_module("control_msgs.action").FollowJointTrajectory
    assert genuine.get_action("control_msgs/action/FollowJointTrajectory") is follow
    assert genuine.get_message("std_msgs/msg/String") is import_module("std_msgs.msg").String
    assert genuine.get_service("std_srvs/srv/Trigger") is import_module("std_srvs.srv").Trigger
