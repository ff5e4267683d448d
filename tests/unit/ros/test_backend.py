"""Which backend nodes run on; both backends offer the same names."""

import ast
import re
from importlib.machinery import PathFinder
from pathlib import Path

import pytest

import throwcollect.ros
from rclzenoh.interfaces.typed_names import ACTIONS, MESSAGES, SERVICES
from throwcollect.errors import ConfigError
from throwcollect.ros import embedded
from throwcollect.ros.middleware import RMW_VARIABLE, VARIABLE, _choose_installed, uses_rclpy
from throwcollect.ros_installation import PACKAGES, missing

ROOT = Path(__file__).parents[3]


@pytest.fixture(autouse=True)
def _fresh():
    _choose_installed.cache_clear()
    yield
    _choose_installed.cache_clear()


@pytest.fixture
def ros(monkeypatch, tmp_path):
    """The files of a ROS 2 with Fast DDS that the check for rclpy looks for; none of them can be imported."""
    for package in ("rclpy", *PACKAGES):
        (tmp_path / package).mkdir()
        (tmp_path / package / "__init__.py").write_text("raise AssertionError")
    index = tmp_path / "share" / "ament_index" / "resource_index" / "rmw_typesupport"
    index.mkdir(parents=True)
    for name in ("rmw_fastrtps_cpp", "rmw_implementation"):
        (index / name).touch()
    # Only this installation is found, even if the machine has another ROS 2.
    monkeypatch.setattr("throwcollect.extras.find_spec", lambda name: PathFinder.find_spec(name, [str(tmp_path)]))
    monkeypatch.setenv("AMENT_PREFIX_PATH", str(tmp_path))
    monkeypatch.setattr("sys.prefix", str(tmp_path))
    monkeypatch.delenv(VARIABLE, raising=False)
    monkeypatch.delenv(RMW_VARIABLE, raising=False)
    return tmp_path


def test_rclpy_is_used_if_it_and_all_interfaces_are_installed(ros, monkeypatch):
    assert uses_rclpy()
    _choose_installed.cache_clear()
    monkeypatch.setenv(VARIABLE, "embedded")
    assert not uses_rclpy()


@pytest.mark.parametrize(
    ("package", "files", "lacking"),
    [
        ("control_msgs", "__init__.py", "control_msgs"),
        ("rclpy", "__init__.py", "rclpy"),
    ],
)
def test_a_missing_package_or_interface_is_an_error_only_if_rclpy_is_asked_for(
    package, files, lacking, ros, monkeypatch
):
    (ros / package / files).unlink()
    assert missing() == [lacking]
    assert not uses_rclpy()
    _choose_installed.cache_clear()
    monkeypatch.setenv(VARIABLE, "rclpy")
    with pytest.raises(ConfigError, match=f"THROWCOLLECT_ROS is rclpy, but Python does not find {lacking}\n  try: "):
        uses_rclpy()


def test_the_embedded_backend_is_used_for_zenoh_if_its_rmw_is_missing(ros, monkeypatch):
    monkeypatch.setenv(RMW_VARIABLE, "rmw_zenoh_cpp")
    assert not uses_rclpy()
    _choose_installed.cache_clear()
    monkeypatch.setenv(VARIABLE, "rclpy")
    with pytest.raises(ConfigError, match="rmw_zenoh_cpp, which is not installed"):
        uses_rclpy()


ROOMS = ("coordinator", "runs", "runtimes", "sim", "episode")


def test_the_check_for_rclpy_covers_all_packages_of_used_interfaces():
    source = ROOT / "src" / "throwcollect"
    rooms = [path for room in ROOMS for path in (source / room).rglob("*.py")]
    named = re.compile(r"""["']([a-z0-9_]+)/(?:msg|srv|action)/""")
    used = {package for path in rooms for package in named.findall(path.read_text(encoding="utf-8"))}
    used |= {name.partition("/")[0] for names in (MESSAGES, SERVICES, ACTIONS) for name in names.values()}
    assert used == {*PACKAGES, *OF_DATASETS}


OF_DATASETS = {"diagnostic_msgs", "visualization_msgs"}
"""Packages of messages that are written into recordings, and that no node sends."""


def test_both_backends_offer_all_names_that_our_nodes_use():
    tree = ast.parse(Path(throwcollect.ros.__file__).with_name("genuine.py").read_text())
    imports = [node for node in tree.body if isinstance(node, ast.ImportFrom)]
    imported = {each.asname or each.name for node in imports for each in node.names}
    made = {node.name for node in tree.body if isinstance(node, ast.FunctionDef)}
    set_to = {ast.unparse(node.targets[0]) for node in tree.body if isinstance(node, ast.Assign)}
    texts = [path.read_text(encoding="utf-8") for path in (ROOT / "src" / "throwcollect").rglob("*.py")]
    lists = [names for text in texts for names in re.findall(r"from throwcollect\.ros import (\([^)]*\)|.*)", text)]
    used = {name for names in lists for name in re.findall(r"\w+", names)}
    used |= {name for text in texts if "import ros\n" in text for name in re.findall(r"\bros\.([A-Za-z_]+)\(", text)}
    used -= {"embedded", "genuine", "msg", "srv", "action", "descriptors"}
    assert {"Node", "spin_some", "ActionClient"} <= used
    assert used - (imported | made | set_to) == set()
    assert [name for name in used if not hasattr(embedded, name)] == []
