"""Libraries are imported where `pyproject.toml` says; the page of the architecture names every room."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator, Mapping
from pathlib import Path

import tomllib
from tests.architecture.parsing import parse

ROOT = Path(__file__).parents[2]
TABLE = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["tool"]["throwcollect"]["imports"]


def list_imported_libraries(tree: ast.Module) -> Iterator[str]:
    """The packages that a module imports, at once or by `lazily`, each by its first name."""
    for node in ast.walk(tree):
        match node:
            case ast.Import(names=names):
                yield from (name.name.partition(".")[0] for name in names)
            case (
                ast.ImportFrom(module=str(name), level=0)
                | ast.Call(func=ast.Name(id="lazily"), args=[ast.Constant(value=str(name)), *_])
            ):
                yield name.partition(".")[0]


def find_misplaced(modules: Mapping[str, str]) -> set[str]:
    """Imports of a library of the table outside of the modules, or packages, that the table names for it."""
    places = {library: [] for libraries in TABLE.values() for library in libraries}
    for place, libraries in TABLE.items():
        for library in libraries:
            places[library].append(f"{place}.")
    return {
        f"{module} imports {library}"
        for module, text in modules.items()
        for library in list_imported_libraries(parse(text))
        if library in places and not f"{module}.".startswith(tuple(places[library]))
    }


def test_libraries_are_imported_only_where_the_table_says() -> None:
    paths = (ROOT / "src").rglob("*.py")
    modules = {
        ".".join(path.relative_to(ROOT / "src").with_suffix("").parts): path.read_text(encoding="utf-8")
        for path in paths
    }
    assert find_misplaced(modules) == set()
    # A name that nothing imports would be a line without effect.
    imported = {library for text in modules.values() for library in list_imported_libraries(parse(text))}
    assert {library for libraries in TABLE.values() for library in libraries} <= imported


def test_an_import_in_another_module_is_found() -> None:
    code = "import numpy, mcap.reader\ndef f():\n    from pybullet import connect\nonnx = lazily('onnx.helper')"
    modules = {"throwcollect.engines.bullet.silence": code, "throwcollect.learning": code, "throwcollect.viewer": code}
    assert find_misplaced(modules) == {
        *(f"throwcollect.engines.bullet.silence imports {library}" for library in ("mcap", "onnx")),
        *(f"throwcollect.learning imports {library}" for library in ("mcap", "pybullet")),
        *(f"throwcollect.viewer imports {library}" for library in ("mcap", "onnx", "pybullet")),
    }


def test_the_page_and_the_figure_of_the_architecture_name_every_room() -> None:
    inside = ROOT / "src" / "throwcollect"
    rooms = {path.stem for path in inside.iterdir() if path.suffix in ("", ".py") and not path.name.startswith("__")}
    page = (ROOT / "docs" / "architecture.md").read_text(encoding="utf-8")
    figure = (ROOT / "docs" / "architecture.svg").read_text(encoding="utf-8")
    assert rooms
    assert {room for room in rooms if f"`{room}`" not in page} == set()
    assert rooms <= set(re.findall(r"\w+", figure))
