"""What programs are told that call a function with a wrong argument."""

from __future__ import annotations

import pytest

from throwcollect.arguments import read_word, refuse_argument
from throwcollect.errors import ConfigError, Problem
from throwcollect.learning.learned_map import Kind


def test_an_argument_is_told_by_its_own_name() -> None:
    error = refuse_argument("where", "got 1", expected="a text", hint="quote it")
    assert error.problems == [Problem("got 1", "where", argument=True)]
    assert str(error) == "where: got 1\n  expected: a text\n  try: quote it"


def test_a_word_is_read_or_refused_with_those_that_there_are() -> None:
    assert read_word("kind", "local", Kind) is Kind.LOCAL
    for given in ("magic", 1, ["local"]):
        with pytest.raises(ConfigError, match=r"^kind: ") as caught:
            read_word("kind", given, Kind)
        assert caught.value.expected == "one of local, polynomial"
