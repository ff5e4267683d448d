"""The table of docs/running.md has every command, and `--help` is well formed."""

import re
from collections.abc import Iterator
from typing import Any

import typer
from tests.pages import read_section

from throwcollect.cli.main import assemble

COMMAND: Any = typer.main.get_command(assemble())


def list_commands(found: Any, path: tuple[str, ...] = ()) -> Iterator[tuple[tuple[str, ...], Any]]:
    """All commands that are not hidden."""
    if hasattr(found, "commands"):
        for name, below in found.commands.items():
            yield from list_commands(below, (*path, name))
    elif not found.hidden:
        yield path, found


def test_the_page_on_running_lists_every_command() -> None:
    table, _, _ = read_section("running.md", "Commands").partition("\n### ")
    cells = re.findall(r"^\| (`.*?`) \| ", table, flags=re.MULTILINE)
    listed = [name for cell in cells for name in re.findall(r"`([^`]*)`", cell)]
    assert sorted(listed) == sorted(" ".join(path) for path, _ in list_commands(COMMAND))


def test_help_shows_optional_arguments_in_one_pair_of_brackets() -> None:
    for path, found in list_commands(COMMAND):
        context = found.make_context(path[-1], [], resilient_parsing=True)
        usage = " ".join(found.collect_usage_pieces(context))
        assert not re.search(r"\[\[|\.\.\.[\]}]", usage), f"{' '.join(path)}: {usage}"
