import re
from pathlib import Path

import pytest

from throwcollect.wording import command, format_count, is_text, join_names, printable


@pytest.mark.parametrize(("number", "said"), [(0, "0 trials"), (1, "1 trial"), (2, "2 trials")])
def test_one_alone_is_singular(number: int, said: str) -> None:
    assert format_count(number, "trial") == said


@pytest.mark.parametrize(
    ("names", "said"),
    [("", ""), ("a", "a"), ("ab", "a and b"), ("abc", "a, b and c"), ("abcdefgh", "a, b, c, d, e and 3 more")],
)
def test_names_stand_in_a_sentence_unless_they_are_many(names: str, said: str) -> None:
    assert join_names(names) == said


def test_a_recommended_command_can_be_typed_as_it_is() -> None:
    assert command("resume", Path("my data/it's")) == """throwcollect resume 'my data/it'"'"'s'"""
    assert command("wait", "--run", "throws-1a2b") == "throwcollect wait --run throws-1a2b"


def test_all_recommended_commands_are_made_so() -> None:
    sources = Path(__file__).parents[2] / "src" / "throwcollect"
    by_hand = re.compile(
        r"throwcollect (up|resume|down|wait|stop|scale|logs|events|dataset|config|plan)\b[a-zA-Z -]*\{"
    )
    found = [path.name for path in sources.rglob("*.py") if by_hand.search(path.read_text(encoding="utf-8"))]
    assert not found


def test_a_message_is_printed_without_what_would_steer_a_terminal_and_without_end() -> None:
    assert printable("no run 'a\x1b[2J\udcff'\n  try: x") == "no run 'a\\x1b[2J\\udcff'\n  try: x"
    assert printable("a" + 5000 * "b" + "c") == "a" + 499 * "b" + " [...] " + 499 * "b" + "c"


def test_a_name_that_is_no_text_is_told_from_one_that_is() -> None:
    assert is_text("größe")
    assert not is_text("a\udcff")
