"""docs/running.md lists the exit code of every error."""

import re

from tests.pages import read_section

from throwcollect.errors import ThrowcollectError


def all_kinds(kind: type[ThrowcollectError]) -> list[type[ThrowcollectError]]:
    return [kind, *(each for below in kind.__subclasses__() for each in all_kinds(below))]


def test_the_page_on_commands_lists_all_exit_codes() -> None:
    listed = re.findall(r"^\| (\d+) \|", read_section("running.md", "Exit codes"), flags=re.MULTILINE)
    raised = {
        kind.exit_code for kind in all_kinds(ThrowcollectError) if kind.__module__ == ThrowcollectError.__module__
    }
    assert [int(code) for code in listed] == sorted({0, *raised})
