"""Rules of the house that no linter knows."""

import ast
import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
SOURCE = ROOT / "src" / "throwcollect"
MODULES = sorted(SOURCE.rglob("*.py"))
VAGUE = {"utils", "util", "helpers", "common", "misc", "base", "core", "types", "manager"}
LONGEST_MODULE = 400
LONGEST_FUNCTION = 60


def name(path: Path) -> str:
    return str(path.relative_to(SOURCE))


@pytest.mark.parametrize("path", MODULES, ids=name)
def test_a_module_is_one_noun(path: Path) -> None:
    text = path.read_text(encoding="utf-8")
    tree = ast.parse(text)
    assert ast.get_docstring(tree) or path.name == "py.typed"
    assert path.stem not in VAGUE
    assert len(text.splitlines()) <= LONGEST_MODULE
    for node in ast.walk(tree):
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
            body = node.end_lineno - node.body[0].lineno + 1
            assert body <= LONGEST_FUNCTION, node.name


@pytest.mark.parametrize("path", MODULES, ids=name)
def test_package_code_never_imports_tests_and_has_no_unfinished_places(path: Path) -> None:
    text = path.read_text(encoding="utf-8")
    assert not re.search(r"^\s*(from|import) (tests|bench)\b", text, flags=re.MULTILINE)
    assert not re.search(r"\b(TODO|FIXME|XXX)\b", text)


def test_package_faces_hold_re_exports_only() -> None:
    for path in SOURCE.rglob("__init__.py"):
        for node in ast.parse(path.read_text(encoding="utf-8")).body:
            plain = isinstance(node, ast.Expr | ast.ImportFrom | ast.Import)
            assert plain or (isinstance(node, ast.Assign) and node.targets[0].id in {"__all__", "__version__"}), path


def test_every_room_of_the_tree_stands_in_the_architecture() -> None:
    text = (ROOT / "docs" / "architecture.md").read_text(encoding="utf-8")
    for room in SOURCE.iterdir():
        if room.is_dir() and (room / "__init__.py").exists():
            assert f"`{room.name}`" in text, room.name
