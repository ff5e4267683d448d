"""What is parsed without the library has the tags, values and lines that the library gives it."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from ruamel.yaml import YAML
from ruamel.yaml.error import YAMLError
from ruamel.yaml.nodes import Node

from throwcollect.config.loader import dump_yaml, load
from throwcollect.config.plain_nodes import compose_plain

CONFIGS = sorted((Path(__file__).parents[3] / "configs").glob("*.yaml"))
VALUES = [
    *("1", "-0", "0.5", "1e-05", "1.", ".5", "007", "1_0", "0x1f", "true", "True", "null", "~", "yes"),
    *("on", "inf", ".inf", "word", "a/b", "a b", "'a'", "[]", "[a, 1]", "{}", "=", "<<"),
    *("{a: 1, b: [2]}", "[a", "{a: 1}}", "&a 1", "*a", "[*a]", "!!str 1", "a # b", "# b", "- a"),
    *("a: b", "[a: b]", "2026-01-01", "1:30", "é", "[1] 2", "--1", "-a", "-", '"a"', '"\\U0000000a"'),
    *('"a" b', '"a', ""),
]
KEYS = ["a", "b", "c.d", "on", "true", "Null", "1", "a b", "-"]
LINES = st.builds(
    lambda indent, key, value: f"{' ' * indent}{key}:{' ' if value else ''}{value}",
    st.sampled_from([0, 0, 2, 2, 4, 1]),
    st.sampled_from(KEYS),
    st.sampled_from([*VALUES, "", "", "1", "word"]),
)


def by_library(text: str) -> Node | None:
    node: Node | None = YAML(typ="safe", pure=True).compose(text)
    return node


def told(node: Any) -> Any:
    """What a configuration is made of."""
    if isinstance(node, (tuple, list)):
        return [told(each) for each in node]
    held = told(node.value) if isinstance(node.value, list) else node.value
    return type(node).__name__, node.tag, held, node.start_mark.line


def assert_as_by_library(text: str) -> None:
    node = compose_plain(text, by_library)
    if node is not None:
        try:
            expected = by_library(text)
        except YAMLError as error:
            raise AssertionError(f"is no YAML: {text!r}") from error
        assert expected is not None
        assert told(node) == told(expected)


@pytest.mark.parametrize("key", KEYS)
def test_a_value_is_what_the_library_makes_of_it_wherever_it_stands(key: str) -> None:
    for value in VALUES:
        assert_as_by_library(f"{key}: {value}\n")
        assert_as_by_library(f"x:\n  {key}: {value}\n  y: 1\nz: 2\n")
        assert_as_by_library(f"{key}: {value}\n  y: 1\nz: 2\n")


@pytest.mark.parametrize("text", ["a:\nb: 1\n", "a:\n", "a:\n    b: 1\n  c: 1\n", "a:\n  b: 1\n c: 1\n", "  a: 1\n"])
def test_keys_of_other_levels_are_left_to_the_library(text: str) -> None:
    assert compose_plain(text, by_library) is None


@given(st.lists(LINES, min_size=1, max_size=6).map(lambda lines: "".join(f"{line}\n" for line in lines)))
def test_any_text_is_parsed_as_by_the_library_or_not_at_all(text: str) -> None:
    assert_as_by_library(text)


@pytest.mark.parametrize("path", CONFIGS, ids=lambda path: path.stem)
def test_what_a_dataset_holds_is_parsed_so(path: Path) -> None:
    text = dump_yaml(load(path))
    node, expected = compose_plain(text, by_library), by_library(text)
    assert node is not None
    assert expected is not None
    assert told(node) == told(expected)
