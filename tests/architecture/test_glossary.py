"""Words that the glossary puts in italics are in no name, comment, docstring or message."""

from __future__ import annotations

import ast
import io
import re
import tokenize
from collections.abc import Iterator
from pathlib import Path

from tests.architecture.parsing import parse

ROOT = Path(__file__).parents[2]
MODULES = sorted((ROOT / "src" / "throwcollect").rglob("*.py"))
PUBLISHED = {"WorkerError"}
"""Names that programs of others catch, and that are older than the glossary."""


def read_forbidden() -> list[str]:
    """The words in italics in the last column of the glossary."""
    rows = re.findall(r"^\| \*\*.*\|$", (ROOT / "docs" / "glossary.md").read_text(encoding="utf-8"), flags=re.MULTILINE)
    return [word for row in rows for word in re.findall(r"(?<!\*)\*(\w[\w ]*)\*(?!\*)", row.split("|")[-2])]


def names(tree: ast.AST) -> Iterator[str]:
    """Names that a module gives; those of other packages are not its own."""
    for node in ast.walk(tree):
        match node:
            case ast.FunctionDef(name=name) | ast.ClassDef(name=name) | ast.arg(arg=name):
                yield name
            case ast.Name(id=name, ctx=ast.Store()) | ast.Attribute(attr=name, ctx=ast.Store()):
                yield name


def texts(code: str) -> Iterator[str]:
    """Comments and strings, docstrings among them."""
    for token in tokenize.generate_tokens(io.StringIO(code).readline):
        if token.type in (tokenize.COMMENT, tokenize.STRING):
            yield re.sub(r"type: ignore\[.*?\]", "", token.string)


def offences(code: str, words: list[str]) -> Iterator[str]:
    pattern = re.compile(rf"\b({'|'.join(words)})s?\b", flags=re.IGNORECASE)
    for name in set(names(parse(code))) - PUBLISHED:
        parts = re.sub(r"(?<=[a-z0-9])(?=[A-Z])", "_", name).replace("_", " ")
        yield from (f"{name}: {found[0]}" for found in pattern.finditer(parts))
    for text in texts(code):
        yield from (f"{text:.60}: {found[0]}" for found in pattern.finditer(text))


def test_forbidden_words_are_not_used() -> None:
    words = read_forbidden()
    found = {path.name: list(offences(path.read_text(encoding="utf-8"), words)) for path in MODULES}
    assert {path: each for path, each in found.items() if each} == {}


def test_the_rule_sees_what_it_should() -> None:
    words = read_forbidden()
    assert {"ticket", "worker", "settings file"} < set(words)
    assert not {"goal", "frame", "session", "trial"} & set(words)
    code = """
from queue import SimpleQueue  # a name of another package
class TicketList:
    'Waiting tickets.'
def run(next_ticket, ticketing):
    raise ValueError(f"no agent")  # the Broker ended it
"""
    found = {offence.rpartition(": ")[2] for offence in offences(code, words)}
    assert found == {"Ticket", "tickets", "ticket", "agent", "Broker"}
    assert list(offences("class WorkerError: ...", words)) == []
