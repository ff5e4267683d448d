import re
from pathlib import Path

import throwcollect
from rclzenoh import interfaces
from rclzenoh.interfaces import message_definition, type_hash
from rclzenoh.interfaces.catalog import structure
from rclzenoh.interfaces.typed_names import ACTIONS, MESSAGES, SERVICES

DEFINITIONS = Path(interfaces.__file__).parent / "definitions"
SOURCE = Path(throwcollect.__file__).parent
TABLE = Path(__file__).with_name("official_hashes.txt")
HASHES = dict(line.split() for line in TABLE.read_text(encoding="utf-8").splitlines())
"""What the official Jazzy generator (rosidl 4.6.9) computes for the packages of Jazzy, implicit types included."""


def test_type_hashes_equal_those_of_the_official_generator():
    assert {name: type_hash(name) for name in HASHES} == HASHES


def test_the_hash_of_everything_that_is_defined_here_is_known():
    defined = {path.relative_to(DEFINITIONS).with_suffix("").as_posix() for path in DEFINITIONS.rglob("*.*")}
    assert defined - set(HASHES) == set()


def test_the_hash_of_everything_that_the_sources_name_is_known():
    interface = re.compile(r'"([a-z0-9_]+/(?:msg|srv|action)/[A-Za-z0-9]+)"')
    named = {name for path in SOURCE.rglob("*.py") for name in interface.findall(path.read_text(encoding="utf-8"))}
    assert {"sensor_msgs/msg/JointState", "tf2_msgs/msg/TFMessage"} <= named
    assert (
        named.union(
            MESSAGES.values(),
            SERVICES.values(),
            ACTIONS.values(),
        )
        - set(HASHES)
        == set()
    )


def test_a_definition_lists_dependencies_once_after_lines_of_80_equal_signs():
    parts = message_definition("sensor_msgs/msg/JointState").split("=" * 80 + "\n")
    assert parts[0].splitlines() == [
        "std_msgs/Header header",
        "string[] name",
        "float64[] position",
        "float64[] velocity",
        "float64[] effort",
    ]
    assert [part.splitlines()[0] for part in parts[1:]] == ["MSG: std_msgs/Header", "MSG: builtin_interfaces/Time"]


def test_defaults_that_the_store_does_not_keep_are_read_from_files():
    assert {field.name: field.default for field in structure("geometry_msgs/msg/Quaternion").fields}["w"] == 1
    assert structure("simulation_interfaces/srv/StepSimulation_Request").fields[0].default == 1
