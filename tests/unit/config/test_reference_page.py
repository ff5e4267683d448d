import pytest

from throwcollect.config.reference_page import page
from throwcollect.config.shape import json_schema

MODELS = {"Config": json_schema(), **json_schema()["$defs"]}
KEYS = [(model, key) for model, schema in MODELS.items() for key in schema["properties"]]


@pytest.mark.parametrize(("model", "key"), KEYS, ids=".".join)
def test_every_key_has_a_description_that_is_a_sentence(model, key):
    node = MODELS[model]["properties"][key]
    meaning = node.get("description") or MODELS[node["$ref"].rpartition("/")[2]]["description"]
    assert meaning.endswith(".")


def test_every_key_is_on_the_reference_page():
    text = page()
    missing = [key for _, key in KEYS if f"`{key}`" not in text and f".{key}`" not in text]
    assert missing == []


def test_rows_of_the_reference_tables_have_equally_many_cells():
    table = 0
    for line in page().splitlines():
        bars = line.count("|") if line.startswith("|") else 0
        assert not table or bars in (0, table)
        table = bars


def test_keys_that_may_be_swept_include_the_offset_of_a_joint():
    swept = page().partition("### Keys that may be swept")[2].partition("##")[0]
    assert "`robot.joint_offsets.<joint>`" in swept
    assert "in `robot.joint_offsets`" in swept
