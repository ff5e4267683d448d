import pytest

from throwcollect.config.kinds import NAME_WORDS
from throwcollect.config.shape import json_schema, shape_of
from throwcollect.members import names_of


@pytest.mark.parametrize(
    ("location", "words"),
    [
        (("trials",), "integer ≥ 1, ≤ 10000000 or null"),
        (("robot",), "keys and values or {urdf: …, flange: …}"),
        (("robot", "name"), " or ".join(map(repr, names_of("robots")))),
        (("robot", "locked"), "'auto' or 'none' or list of joint"),
        (("robot", "controllers"), f"mapping from {NAME_WORDS} to list of string or {{chain: …}} or null"),
        (("task", "trajectory", "weights"), "mapping from joint to list of number rad"),
        (("sweep", "parameters"), "mapping from key to {min: …, max: …} or {values: …}"),
        (("nowhere",), "anything"),
    ],
)
def test_the_shape_of_a_key_says_in_words_what_it_holds(location, words):
    assert str(shape_of(location)) == words


def test_the_shape_of_a_union_has_the_keys_of_all_alternatives():
    assert {"gamma", "alpha_z"} < set(shape_of(("task", "trajectory")).keys)
    alternatives = shape_of(("task", "trajectory")).alternatives
    assert set(alternatives[0].keys) == {"family", "gamma"}


def test_the_json_schema_names_its_standard_and_forbids_unknown_keys():
    schema = json_schema()
    assert schema["$schema"] == "https://json-schema.org/draft/2020-12/schema"
    assert not schema["additionalProperties"]
    assert all(not model["additionalProperties"] for model in schema["$defs"].values())
