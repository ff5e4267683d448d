import re
from pathlib import Path

import pytest

from throwcollect.wording import command, counted


@pytest.mark.parametrize(("number", "said"), [(0, "0 trials"), (1, "1 trial"), (2, "2 trials")])
def test_one_alone_is_singular(number: int, said: str) -> None:
    assert counted(number, "trial") == said


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
