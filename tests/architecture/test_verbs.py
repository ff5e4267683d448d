"""Names of functions are verbs: a participle leaves open whether a function looks up, makes or changes something."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from pathlib import Path

from tests.architecture.parsing import parse

ROOT = Path(__file__).parents[2]
FOLDERS = ("src", "tests", "bench", "docker", "packaging", "examples")
IRREGULAR = """
begun born bound bought broken brought built caught chosen done drawn driven fallen felt flown forgotten found given
gone grown heard held hidden kept known laid led left lost made meant met paid said seen sent shown sought sold spent
spoken stolen struck swept taken taught thought thrown told torn withdrawn won worn written
"""
NO_PARTICIPLES = ("embed", "exceed", "feed", "need", "proceed", "seed", "succeed")
OTHERS_CALL_IT = {"canceled", "padded", "measured"}
"""Participles that are allowed: names of rclpy, of the published interface, and of functions that declare a field."""


def is_participle(word: str) -> bool:
    return word in IRREGULAR.split() or (word.endswith("ed") and word not in NO_PARTICIPLES)


def participles(tree: ast.AST) -> Iterator[str]:
    """Functions whose first word is a participle.

    Properties and what tests are given by pytest are things, what is true or not may be told by a participle, and what
    makes an error is called by what is wrong, as in ``raise malformed(...)``.
    """
    for node in ast.walk(tree):
        if not isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
            continue
        is_thing = any(kind in ast.unparse(each) for each in node.decorator_list for kind in ("property", "fixture"))
        returns = ast.unparse(node.returns) if node.returns is not None else ""
        if (
            not is_thing
            and returns != "bool"
            and not returns.endswith("Error")
            and is_participle(node.name.strip("_").split("_")[0])
        ):
            yield node.name


def test_functions_are_verbs() -> None:
    paths = sorted(path for folder in FOLDERS for path in (ROOT / folder).rglob("*.py"))
    found = {
        str(path.relative_to(ROOT)): set(participles(parse(path.read_text(encoding="utf-8")))) - OTHERS_CALL_IT
        for path in paths
    }
    assert {path: names for path, names in found.items() if names} == {}


def test_the_rule_finds_functions_that_are_participles() -> None:
    code = """
def checked_plan() -> Plan: ...
def _found(): ...
def feed(): ...
def seed_of(): ...
def read_plan(): ...
async def _heard(): ...
@pytest.fixture(scope="module")
def collected() -> Path: ...
class Lease:
    @property
    def ended(self) -> int: ...
    @cached_property
    def taken(self) -> int: ...
    def finished(self) -> bool: ...
    def malformed(self) -> RequestError: ...
    def held_by(self) -> int: ...
"""
    assert list(participles(parse(code))) == ["checked_plan", "_found", "_heard", "held_by"]
