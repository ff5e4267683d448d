"""Errors for programs that call a function with a wrong argument."""

import re

import pytest

from throwcollect.arguments import check_bounds, read_word
from throwcollect.errors import ConfigError
from throwcollect.learning.aiming import Choice


@pytest.mark.parametrize(("given", "expected"), [(0, "1 to 9"), (10, "1 to 9")])
def test_a_number_out_of_bounds_is_refused_by_the_name_of_its_argument(given: int, expected: str) -> None:
    with pytest.raises(ConfigError, match=rf"^replay: got {given}\n  expected: {expected}$"):
        check_bounds("replay", given, least=1, most=9)


def test_a_number_that_is_no_integer_is_a_type_error() -> None:
    with pytest.raises(TypeError, match="integer"):
        check_bounds("replay", 1.5, least=1)  # type: ignore[arg-type]


def test_a_wrong_word_is_refused_with_those_that_may_be_meant() -> None:
    with pytest.raises(ConfigError, match=re.escape("choose: 'least-efort'; did you mean 'least-effort'?")):
        read_word("choose", "least-efort", Choice)
