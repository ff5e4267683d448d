"""docs/cli.md lists the exit code of every error."""

import re
from pathlib import Path

from throwcollect.errors import ThrowcollectError

PAGE = Path(__file__).parents[3] / "docs" / "cli.md"


def all_kinds(kind: type[ThrowcollectError]) -> list[type[ThrowcollectError]]:
    return [kind, *(each for below in kind.__subclasses__() for each in all_kinds(below))]


def test_the_page_on_commands_lists_all_exit_codes() -> None:
    section = PAGE.read_text(encoding="utf-8").partition("## Exit codes")[2].partition("\n## ")[0]
    told = [int(code) for code in re.findall(r"^\| (\d+) \|", section, flags=re.MULTILINE)]
    raised = {
        kind.exit_code for kind in all_kinds(ThrowcollectError) if kind.__module__ == ThrowcollectError.__module__
    }
    assert told == sorted({0, *raised})
