"""Errors for programs that call a function with a wrong argument."""

from __future__ import annotations

import math
from collections.abc import Iterable
from pathlib import Path

import numpy as np
import pytest

from throwcollect.arguments import (
    as_float,
    check_list,
    check_mapping,
    check_whole_number,
    read_list,
    read_path,
    read_word,
    refuse_argument,
)
from throwcollect.errors import ConfigError, Problem
from throwcollect.learning.learned_map import Kind


def test_an_error_of_an_argument_names_it() -> None:
    error = refuse_argument("where", "got 1", expected="a text", hint="quote it")
    assert error.problems == [Problem("got 1", "where", argument=True)]
    assert str(error) == "where: got 1\n  expected: a text\n  try: quote it"


def test_an_unknown_word_is_refused_with_the_known_ones() -> None:
    assert read_word("kind", "local", Kind) is Kind.LOCAL
    for given in ("magic", 1, ["local"]):
        with pytest.raises(ConfigError, match=r"^kind: .*; known: local and polynomial$"):
            read_word("kind", given, Kind)


@pytest.mark.parametrize(
    ("given", "problem", "expected"),
    [
        ("a", "'a' is a text", "a list of names: ['a']"),
        (b"a", "b'a' is a text", "a list of names"),
        ({"a": 1}, "{'a': 1} is a mapping", "a list of names"),
        (1, "1 is no list", "a list of names"),
        (["a", 1], "1 is in the list", "a list of names"),
        (["a", ("b" * 200,)], f"('{'b' * 78}… is in the list", "a list of names"),
    ],
)
def test_a_value_that_is_no_list_is_refused(given: object, problem: str, expected: str) -> None:
    with pytest.raises(ConfigError) as caught:
        read_list("columns", given, "names")
    assert caught.value.problems == [Problem(problem, "columns", argument=True)]
    assert caught.value.expected == expected


def test_any_iterable_but_a_text_counts_as_a_list() -> None:
    assert read_list("columns", (name for name in "ab"), "names") == read_list("columns", ["a", "b"], "names")
    rows = np.eye(2)
    assert [row.tolist() for row in read_list("targets", rows, "targets", (Iterable,))] == rows.tolist()
    with pytest.raises(ConfigError) as caught:
        read_list("targets", "1,0", "targets", (Iterable,))
    assert caught.value.expected == "a list of targets"


def test_check_list_does_not_consume_an_iterator() -> None:
    points = iter([1, 2])
    check_list("points", points, "points")
    assert list(points) == [1, 2]


def test_as_float_returns_nan_for_a_value_that_is_no_number() -> None:
    assert as_float(np.float32(0.5)) == as_float(np.array(0.5)) == 0.5
    assert all(math.isnan(as_float(each)) for each in ("a", "0.5", True, np.True_, None, [1], 10**400))


def test_a_path_is_a_text_or_a_path_of_text() -> None:
    assert read_path("output", "a/b") == read_path("output", Path("a/b")) == Path("a/b")
    for given in (None, 5, b"a", ["a"]):
        with pytest.raises(ConfigError, match=r"^output: got .*\n  expected: a path, as text or a Path"):
            read_path("output", given)
    for given in ("a\0b", "a" * 300):
        with pytest.raises(ConfigError, match=r"^a.*: no file can have this name"):
            read_path("output", given)


def test_a_number_that_is_not_whole_or_out_of_bounds_is_refused() -> None:
    for given in (1, 3, np.int64(2)):
        check_whole_number("processes", given, least=1, most=3)
    for given, expected in (
        (0, "1 to 3"),
        (4, "1 to 3"),
        (1.5, "a whole number, 1 to 3"),
        (True, "a whole number, 1 to 3"),
    ):
        with pytest.raises(ConfigError, match=f"^processes: got {given}") as caught:
            check_whole_number("processes", given, least=1, most=3)
        assert caught.value.expected == expected
    with pytest.raises(ConfigError, match=r"^replay: got '1'\n  expected: a whole number, 0 or more$"):
        check_whole_number("replay", "1", least=0)


@pytest.mark.parametrize("given", [[1], "a", {1: 2}])
def test_a_value_that_is_no_mapping_is_refused(given: object) -> None:
    check_mapping("values", {"a": 1}, "{'a': 1}")
    with pytest.raises(ConfigError, match=r"^values: got .*\n  expected: a mapping, such as {'a': 1}$"):
        check_mapping("values", given, "{'a': 1}")
