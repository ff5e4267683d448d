import pytest

from throwcollect.config.schema import Config
from throwcollect.config.shape import json_schema, shape_of, unit_of_key


@pytest.mark.parametrize(
    ("key", "words"),
    [
        ("trials", "integer ≥ 1, ≤ 10000000 or null"),
        ("robot", "keys and values or {urdf: …, flange: …}"),
        ("robot.locked", "'auto' or 'none' or list of string"),
        ("task.trajectory.weights", "mapping to list of number rad"),
        ("nowhere", "anything"),
    ],
)
def test_the_shape_of_a_key_is_its_kind_with_bounds_and_unit(key: str, words: str) -> None:
    assert str(shape_of(key)) == words


def test_the_shape_of_a_union_has_the_keys_of_all_alternatives() -> None:
    assert {"gamma", "alpha_z"} < set(shape_of("task.trajectory").keys)
    assert set(shape_of("task.trajectory").alternatives[0].keys) == {"family", "gamma"}


def test_the_unit_of_a_key_is_that_of_its_field_or_of_its_name() -> None:
    assert [unit_of_key(key) for key in ("task.trajectory.weights.a.1", "ball.mass_kg", "x_m")] == ["rad", "kg", "m"]


def test_the_json_schema_names_its_standard_and_forbids_unknown_keys() -> None:
    schema = json_schema(Config)
    assert schema["$schema"] == "https://json-schema.org/draft/2020-12/schema"
    assert not schema["additionalProperties"]
    assert all(not model["additionalProperties"] for model in schema["$defs"].values())
