"""How documents are printed."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from throwcollect.cli.printing import print_json, print_json_list


@pytest.mark.parametrize("items", [[], [1], [{"a": ["b\n", {}], "c": None}, [], "d"]])
def test_a_list_is_printed_item_by_item_as_it_is_at_once(
    items: list[object], capsys: pytest.CaptureFixture[str]
) -> None:
    print_json(items)
    expected = capsys.readouterr().out
    print_json_list(items)
    assert capsys.readouterr().out == expected


def test_items_of_a_list_are_printed_before_the_next_ones_are_made(capsys: pytest.CaptureFixture[str]) -> None:
    def make() -> Iterator[int]:
        for number in range(1, 4):
            yield number
            assert capsys.readouterr().out.endswith(f"\n  {number}")

    print_json_list(make())
    assert capsys.readouterr().out == "\n]\n"
