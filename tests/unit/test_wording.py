from pathlib import Path

import pytest

from throwcollect.wording import command, join_names, printable, suggest


@pytest.mark.parametrize(
    ("names", "said"),
    [("", ""), ("a", "a"), ("ab", "a and b"), ("abc", "a, b and c"), ("abcdefgh", "a, b, c, d, e and 3 more")],
)
def test_join_names_counts_the_names_after_the_fifth(names: str, said: str) -> None:
    assert join_names(names) == said


@pytest.mark.parametrize(
    ("name", "near"),
    [
        ("landing_x", "'landing_x_m'"),
        ("landing", "'landing_x_m', 'landing_y_m' or 'landing_vx_mps'"),
        ("Duration_S", "'task.duration_s'"),
    ],
)
def test_a_wrong_name_is_answered_by_those_that_contain_it_or_else_by_similar_ones(name: str, near: str) -> None:
    known = ["trial", "outcome", "task.duration_s", "landing_x_m", "landing_vx_mps", "landing_y_m", "landing_vy_mps"]
    assert suggest(name, known, "docs/dataset.md") == f"; did you mean {near}?"


def test_a_recommended_command_is_quoted_for_the_shell() -> None:
    assert command("resume", Path("my data/it's")) == """throwcollect resume 'my data/it'"'"'s'"""
    assert command("wait", "--run", "throws-1a2b") == "throwcollect wait --run throws-1a2b"


def test_a_printed_message_is_escaped_for_terminals() -> None:
    assert printable("no run 'a\x1b[2J\udcff'\n  try: x") == "no run 'a\\x1b[2J\\udcff'\n  try: x"
