"""Words that the glossary puts in italics are in no name, comment, docstring, message or document."""

from __future__ import annotations

import ast
import io
import re
import tokenize
from collections.abc import Iterator
from pathlib import Path

from tests.architecture.parsing import parse

ROOT = Path(__file__).parents[2]
GLOSSARY = ROOT / "docs" / "glossary.md"
FOLDERS = ("src", "tests", "bench", "docker", "packaging", "examples")
MODULES = sorted({path for folder in FOLDERS for path in (ROOT / folder).rglob("*.py")} - {Path(__file__)})
PAGES = sorted({*(ROOT / "docs").rglob("*.md"), *ROOT.glob("*.md")} - {GLOSSARY})
COMMENTED = sorted(
    [
        ROOT / "Makefile",
        ROOT / "docker" / "Dockerfile",
        *(
            path
            for folder in ("docker", "packaging", "compose", "configs")
            for ending in ("sh", "def", "yaml", "toml")
            for path in (ROOT / folder).rglob(f"*.{ending}")
        ),
    ]
)
"""Files that are no Python, whose comments begin with ``#``."""
SCRIPTS = sorted((ROOT / "src" / "throwcollect" / "serve" / "page").glob("*.js"))

ALLOWED = {
    "WorkerError": "programs of others catch it, and it is older than the glossary",
}
"""Names that have a forbidden word in them, and why. In documents, words of other programs stand as code: `rollout`."""


def read_forbidden() -> list[str]:
    """The words in italics in the last column of the glossary."""
    rows = re.findall(r"^\| \*\*.*\|$", GLOSSARY.read_text(encoding="utf-8"), flags=re.MULTILINE)
    return [word for row in rows for word in re.findall(r"(?<!\*)\*(\w[\w ]*)\*(?!\*)", row.split("|")[-2])]


def find_words(text: str, words: list[str]) -> list[str]:
    """Find forbidden words in a text, in the singular or the plural; a line may end between two words of one term."""
    alternatives = "|".join(words).replace(" ", r"\s+")
    return [found[0] for found in re.finditer(rf"\b(?:{alternatives})s?\b", text, flags=re.IGNORECASE)]


def list_names(tree: ast.AST) -> Iterator[str]:
    """Names that a module gives; those of other packages are not its own."""
    for node in ast.walk(tree):
        match node:
            case ast.FunctionDef(name=name) | ast.AsyncFunctionDef(name=name) | ast.ClassDef(name=name):
                yield name
            case ast.Name(id=name, ctx=ast.Store()) | ast.Attribute(attr=name, ctx=ast.Store()) | ast.arg(arg=name):
                yield name


def list_texts(code: str) -> Iterator[str]:
    """Comments and strings, docstrings among them."""
    for token in tokenize.generate_tokens(io.StringIO(code).readline):
        if token.type in (tokenize.COMMENT, tokenize.STRING):
            yield re.sub(r"type: ignore\[.*?\]", "", token.string)


def find_offences(code: str, words: list[str]) -> Iterator[str]:
    """Forbidden words in a module of Python, each after the name or the text that has it."""
    for name in sorted(set(list_names(parse(code))) - set(ALLOWED)):
        parts = re.sub(r"(?<=[a-z0-9])(?=[A-Z])", "_", name).replace("_", " ")
        yield from (f"{name}: {word}" for word in find_words(parts, words))
    # Most modules have none of the words anywhere, and taking one apart takes far longer than this search.
    for text in list_texts(code) if find_words(code, words) else ():
        yield from (f"{text:.60}: {word}" for word in find_words(text, words))


def read_prose(page: str) -> str:
    """Read the prose of a page of Markdown, without code and without changes of published versions."""
    unreleased = re.sub(r"^## \[\d.*", "", page, flags=re.MULTILINE | re.DOTALL)
    no_blocks = re.sub(r"^( *)```.*?^\1```$", "", unreleased, flags=re.MULTILINE | re.DOTALL)
    return re.sub(r"`[^`]*`", "", re.sub(r"^    .*$", "", no_blocks, flags=re.MULTILINE))


def read_comments(text: str) -> str:
    """Comments of a file in which they begin with ``#``."""
    return "\n".join(re.findall(r"(?:^|(?<=\s))#.*$", text, flags=re.MULTILINE))


def test_forbidden_words_are_not_used_in_python() -> None:
    words = read_forbidden()
    found = {str(path): list(find_offences(path.read_text(encoding="utf-8"), words)) for path in MODULES}
    assert {path: each for path, each in found.items() if each} == {}


def test_forbidden_words_are_not_used_in_documents_scripts_and_comments() -> None:
    words = read_forbidden()
    texts = {path: read_prose(path.read_text(encoding="utf-8")) for path in PAGES}
    texts |= {path: read_comments(path.read_text(encoding="utf-8")) for path in COMMENTED}
    texts |= {path: path.read_text(encoding="utf-8") for path in SCRIPTS}
    found = {str(path): find_words(text, words) for path, text in texts.items()}
    assert {path: each for path, each in found.items() if each} == {}
    assert len(PAGES) > 50
    assert len(COMMENTED) > 10
    assert len(SCRIPTS) > 5


def test_the_rule_finds_forbidden_words_in_python() -> None:
    words = read_forbidden()
    assert {"ticket", "worker", "settings file"} < set(words)
    assert not {"goal", "frame", "session", "trial"} & set(words)
    code = """
from queue import SimpleQueue  # a name of another package
class TicketList:
    'Waiting tickets.'
def run(next_ticket, ticketing):
    raise ValueError(f"no agent")  # the Broker ended it
async def roll_experiment(): ...
"""
    found = {offence.rpartition(": ")[2] for offence in find_offences(code, words)}
    assert found == {"Ticket", "tickets", "ticket", "agent", "Broker", "experiment"}
    assert list(find_offences("class WorkerError: ...", words)) == []


def test_the_rule_finds_forbidden_words_in_documents() -> None:
    words = read_forbidden()
    page = """
Its workers read the settings
file, and `rollout` of MuJoCo does not.

    broker --port 7447

1. A list:
   ```sh
   ticket
   ```

## [Unreleased]
A skill.
## [0.1.0] - 2025-01-01
An agent.
"""
    assert find_words(read_prose(page), words) == ["workers", "settings\nfile", "skill"]


def test_the_rule_finds_forbidden_words_in_comments() -> None:
    text = "# An agent.\nrun worker  # of a broker\ncurl a#ticket\n"
    assert find_words(read_comments(text), read_forbidden()) == ["agent", "broker"]
