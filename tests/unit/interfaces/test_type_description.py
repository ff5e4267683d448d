"""Type descriptions, which whoever receives them can check by their hash."""

import json
from hashlib import sha256

import pytest
from tests.unit.interfaces.test_catalog import HASHES

from throwcollect.interfaces import type_hash
from throwcollect.interfaces.type_description import type_description, type_sources

FJT = "control_msgs/action/FollowJointTrajectory"


def hashed(description):
    """Hash of a description that was received, by the rule of REP 2016."""

    def individual(each):
        return {
            "type_name": each.type_name,
            "fields": [
                {
                    "name": field.name,
                    "type": {
                        "type_id": int(field.type.type_id),
                        "capacity": int(field.type.capacity),
                        "string_capacity": int(field.type.string_capacity),
                        "nested_type_name": field.type.nested_type_name,
                    },
                }
                for field in each.fields
            ],
        }

    content = {
        "type_description": individual(description.type_description),
        "referenced_type_descriptions": list(map(individual, description.referenced_type_descriptions)),
    }
    return f"RIHS01_{sha256(json.dumps(content).encode()).hexdigest()}"


@pytest.mark.parametrize("name", HASHES)
def test_a_description_has_the_hash_of_its_type(name):
    assert hashed(type_description(name)) == type_hash(name)


def test_a_description_tells_default_values():
    fields = type_description("geometry_msgs/msg/Quaternion").type_description.fields
    assert {field.name: field.default_value for field in fields} == {"x": "0.0", "y": "0.0", "z": "0.0", "w": "1.0"}
    fields = type_description("rcl_interfaces/msg/ParameterDescriptor").type_description.fields
    assert {field.name for field in fields if field.default_value == "False"} == {"read_only", "dynamic_typing"}


def test_sources_are_those_of_the_type_and_of_all_that_it_consists_of():
    description, sources = type_description(FJT), type_sources(FJT)
    names = [description.type_description, *description.referenced_type_descriptions]
    assert [source.type_name for source in sources] == [each.type_name for each in names]
    by_name = {source.type_name: source for source in sources}
    assert by_name[FJT].encoding == "action"
    assert by_name[FJT].raw_file_contents.count("---") == 2
    assert by_name[f"{FJT}_Goal"].encoding == "implicit"
    assert by_name[f"{FJT}_Goal"].raw_file_contents == ""
    assert by_name["control_msgs/msg/JointTolerance"].encoding == "msg"
    assert by_name["std_msgs/msg/Header"].raw_file_contents == "builtin_interfaces/Time stamp\nstring frame_id\n"


def test_an_unknown_type_has_no_description():
    with pytest.raises(ValueError, match="unknown interface 'a/msg/B'"):
        type_description("a/msg/B")
