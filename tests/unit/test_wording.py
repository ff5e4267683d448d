import re
from pathlib import Path

import pytest

from throwcollect.wording import command, format_count, join_names, printable, suggest


@pytest.mark.parametrize(("number", "said"), [(0, "0 trials"), (1, "1 trial"), (2, "2 trials")])
def test_a_count_of_one_is_singular(number: int, said: str) -> None:
    assert format_count(number, "trial") == said


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
        ("lnading_y_m", "'landing_y_m'"),
    ],
)
def test_a_wrong_name_is_answered_by_those_that_contain_it_or_else_by_similar_ones(name: str, near: str) -> None:
    known = ["trial", "outcome", "task.duration_s", "landing_x_m", "landing_vx_mps", "landing_y_m", "landing_vy_mps"]
    assert suggest(name, known, "docs/dataset.md") == f"; did you mean {near}?"


@pytest.mark.parametrize("name", ["x", "", "distance", "landing" * 100, None, 3])
def test_a_name_that_is_like_none_is_answered_by_all_or_by_the_page(name: object) -> None:
    few, many = ["grid", "list", "sobol"], [f"landing_{each}_m" for each in "uvwxyzabc"]
    assert suggest(name, few, "docs/learning.md") == "; known: grid, list and sobol"
    assert suggest(name, many, "docs/dataset.md") == "; docs/dataset.md lists all"
    assert suggest(name, many).endswith("and 4 more")
    assert suggest(name, []) == "; there is none"


def test_a_recommended_command_is_quoted_for_the_shell() -> None:
    assert command("resume", Path("my data/it's")) == """throwcollect resume 'my data/it'"'"'s'"""
    assert command("wait", "--run", "throws-1a2b") == "throwcollect wait --run throws-1a2b"


def test_no_module_writes_a_recommended_command_by_hand() -> None:
    sources = Path(__file__).parents[2] / "src" / "throwcollect"
    by_hand = re.compile(
        r"throwcollect (up|resume|down|wait|stop|scale|logs|events|dataset|config|plan)\b[a-zA-Z -]*\{"
    )
    found = [path.name for path in sources.rglob("*.py") if by_hand.search(path.read_text(encoding="utf-8"))]
    assert not found


def test_a_printed_message_is_escaped_for_terminals() -> None:
    assert printable("no run 'a\x1b[2J\udcff'\n  try: x") == "no run 'a\\x1b[2J\\udcff'\n  try: x"
