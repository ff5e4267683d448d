"""What is written and read without the library is what the library writes and reads."""

from __future__ import annotations

import io
import json
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from ruamel.yaml import YAML

from throwcollect.dataset import plain_yaml

DIGEST = "0456e9c3dd8061ff1d69712717e76fd9122b095c1df750cbd5f4a6ba667ac011"
ODD = "a:|~|x y|é|a\nb|#a|inf|nan|---|a-|/|0b01|0x1f|1:30|'|a'|-|null|True|on|Y|1|007|1e5|/a/b|a.b|"
TEXTS = st.sampled_from([*ODD.split("|"), DIGEST, "1" * 64, "1e" + "1" * 62]) | st.text(
    "abefnotryYN01_./- :", max_size=6
)
VALUES = TEXTS | st.integers() | st.booleans() | st.none() | st.floats(allow_nan=False, allow_infinity=False)
USUAL = st.sampled_from(["", "a", "/a/b", "a.b", "12", DIGEST]) | st.integers() | st.booleans()


def mappings(keys: st.SearchStrategy[str], values: st.SearchStrategy[Any]) -> st.SearchStrategy[dict[str, Any]]:
    def inside(children: st.SearchStrategy[Any]) -> st.SearchStrategy[Any]:
        return st.lists(children, max_size=3) | st.dictionaries(keys, children, max_size=3)

    return st.dictionaries(keys, st.recursive(values, inside, max_leaves=8), min_size=1, max_size=3)


def by_library(data: Any) -> str:
    yaml = YAML()
    yaml.width = 4096
    stream = io.StringIO()
    yaml.dump(json.loads(json.dumps(data)), stream)
    return stream.getvalue()


@given(mappings(TEXTS, VALUES) | mappings(st.sampled_from("abc"), VALUES) | mappings(st.sampled_from("abc"), USUAL))
def test_it_is_the_text_of_the_library_or_none(data: dict[str, Any]) -> None:
    text = plain_yaml.write(data)
    assert text in (None, by_library(data))
    if text is not None:
        assert plain_yaml.read(text) in (None, data)


@given(
    st.dictionaries(st.sampled_from("abc"), USUAL | st.lists(USUAL | st.dictionaries(st.sampled_from("abc"), USUAL)))
)
def test_what_is_usual_needs_no_library(data: dict[str, Any]) -> None:
    text = plain_yaml.write(data)
    assert text is not None
    assert plain_yaml.read(text) == (data or None)
    assert (YAML(typ="safe", pure=True).load(text) or {}) == data


@given(st.text("ab1:- '{}[]&*!#\n", max_size=30))
def test_any_text_is_read_as_by_the_library_or_not_at_all(text: str) -> None:
    data = plain_yaml.read(text)
    assert data is None or data == YAML(typ="safe", pure=True).load(text)


@pytest.mark.parametrize(
    "text",
    ["a: 1", "a:  1\n", "a: 1\na: 2\n", "a: &b 1\n", "a: !!str 1\n", "a:\n-  b: 1\n", "a:\n- - b: 1\n", "- a\n", "\n"],
)
def test_other_texts_are_left_to_the_library(text: str) -> None:
    assert plain_yaml.read(text) is None
