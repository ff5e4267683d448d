import pytest

from throwcollect.config.shape import json_schema, shape_of


@pytest.mark.parametrize(
    ("location", "words"),
    [
        (("seed",), "a whole number from 0 to 4294967295"),
        (("trials",), "a whole number from 1 to 10000000 or null"),
        (("robot",), "keys and values"),
        (("robot", "name"), "'talos'"),
        (("robot", "position_gain_per_s"), "a number above 0 and up to 1000 1/s"),
        (("scene", "air_density_kgpm3"), "a number from 0 to 10 kg/m³"),
        (("scene", "gravity_mps2"), "a number above 0 and up to 30 m/s²"),
        (("task", "end", "torso_1_joint"), "a number from -6.3 to 6.3 rad"),
        (("task", "trajectory", "weights"), "joint names, each with a list of numbers in rad"),
        (("task", "trajectory", "weights", "torso_1_joint", 3), "a number in rad"),
        (("sweep", "parameters"), "keys, each with {min: …, max: …} or {values: …}"),
        (("sweep", "parameters", "ball.mass_kg", "min"), "a number in kg"),
        (("sweep", "parameters", "ball.mass_kg", "count"), "a whole number from 1 to 10000000 or null"),
        (("sweep", "parameters", "ball.mass_kg", "values"), "a list of numbers in kg"),
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
