"""Errors for programs that call a function with a wrong argument."""

import pytest

from throwcollect.errors import ConfigError, check_bounds


@pytest.mark.parametrize(("given", "expected"), [(0, "1 to 9"), (10, "1 to 9")])
def test_a_number_out_of_bounds_is_refused_by_the_name_of_its_argument(given: int, expected: str) -> None:
    with pytest.raises(ConfigError, match=rf"^replay: got {given}\n  expected: {expected}$"):
        check_bounds("replay", given, least=1, most=9)
