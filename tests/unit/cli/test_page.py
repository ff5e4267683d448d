"""The tables of docs/cli.md have every command with its options, and `--help` is well formed."""

import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import typer

from throwcollect.cli.main import assemble

COMMAND: Any = typer.main.get_command(assemble())
PAGE = (Path(__file__).parents[3] / "docs" / "cli.md").read_text(encoding="utf-8")


def find_commands(words: list[str], found: Any, path: tuple[str, ...] = ()) -> Iterator[tuple[str, ...]]:
    """Paths of the commands that a line such as `dataset filter|sample DIR` means."""
    if not hasattr(found, "commands") or not words or words[0] == "...":
        yield path
        return
    for name in words[0].split("|"):
        assert name in found.commands, f"{' '.join([*path, name])}: there is no such command"
        yield from find_commands(words[1:], found.commands[name], (*path, name))


def list_commands(found: Any, path: tuple[str, ...] = ()) -> Iterator[tuple[tuple[str, ...], Any]]:
    """All commands that are not hidden."""
    if hasattr(found, "commands"):
        for name, below in found.commands.items():
            yield from list_commands(below, (*path, name))
    elif not found.hidden:
        yield path, found


def read_options() -> dict[tuple[str, ...], set[str]]:
    """The options that the page lists for each command."""
    told: dict[tuple[str, ...], set[str]] = {}
    for cell in re.findall(r"^\| (`.*?`) \| ", PAGE, flags=re.MULTILINE):
        for line in re.findall(r"`([^`]*)`", cell.replace("\\|", "|")):
            for path in find_commands(line.split(), COMMAND):
                told.setdefault(path, set()).update(re.findall(r"(?<![\w-])--?[a-z][a-z-]*", line))
    return told


def test_the_page_on_commands_has_every_command_with_its_options() -> None:
    told, wrong = read_options(), []
    for path, found in list_commands(COMMAND):
        if path not in told:
            wrong.append(f"{' '.join(path)}: is missing")
            continue
        # Options in the line of a group, such as `ros topic|param ... [--run RUN]`, belong to all its commands.
        named = set().union(*(told.get(path[:length], ()) for length in range(1, len(path) + 1)))
        options = [
            each.opts + each.secondary_opts
            for each in found.params
            if each.param_type_name == "option" and each.name != "help"
        ]
        known = {name for names in options for name in names}
        wrong += [f"{' '.join(path)}: has no {name}" for name in sorted(told[path] - known)]
        wrong += [f"{' '.join(path)}: {names[0]} is missing" for names in options if not named & set(names)]
    assert wrong == []


def test_help_shows_optional_arguments_in_one_pair_of_brackets() -> None:
    for path, found in list_commands(COMMAND):
        context = found.make_context(path[-1], [], resilient_parsing=True)
        usage = " ".join(found.collect_usage_pieces(context))
        assert not re.search(r"\[\[|\.\.\.[\]}]", usage), f"{' '.join(path)}: {usage}"
