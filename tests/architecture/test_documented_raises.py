"""Docstrings of the public API, and of what other packages implement, name the errors that are raised.

The linter's rule of this kind (ruff's DOC501) cannot be used: it takes functions that make an error for errors, as in
``raise unreadable(...)``, and asks for what a function itself catches.
DOC502, by which only what a function itself raises may stand there, would take away what callers need: what passes
through counts, too.
"""

from __future__ import annotations

import ast
import builtins
import re
from collections.abc import Iterator, Mapping
from pathlib import Path

from tests.architecture.parsing import parse

import throwcollect

ROOT = Path(__file__).parents[2]
MODULES = {path: path.read_text(encoding="utf-8") for path in sorted((ROOT / "src").rglob("*.py"))}
FAMILIES = (
    "engines.engine",
    "tasks.task",
    "robots.tools.tool",
    "robots.robot",
    "collect.runtimes.runtime",
    "publish.export.exporter",
)
"""Modules of what other packages implement."""


def list_public_modules() -> list[Path]:
    """The modules whose names `throwcollect` offers to other programs, and those of families."""
    modules = [place.partition(":")[0] for place in throwcollect._PLACES.values()]
    source = ROOT / "src" / "throwcollect"
    places = [
        source / module.replace(".", "/") for module in (*modules, *FAMILIES) if module not in ("errors", "extras")
    ]
    return sorted({place / "__init__.py" if place.is_dir() else place.with_suffix(".py") for place in places})


RAISES = re.compile(r"^ *Raises:\n((?: +.*\n?|\n)+)", flags=re.MULTILINE)


def last_name(node: ast.expr | None) -> str:
    """The name behind the last dot of a class or function, called or not."""
    match node:
        case ast.Call(func=inner) | ast.Subscript(value=inner):
            return last_name(inner)
        case ast.Attribute(attr=name) | ast.Name(id=name) | ast.Constant(value=str(name)):
            return name
    return ""


class Errors:
    """Classes of errors with those that they descend from, and the functions that make one."""

    def __init__(self, texts: Mapping[Path, str]) -> None:
        self._bases: dict[str, list[str]] = {}
        self._makers: dict[str, str] = {}
        for node in (node for text in texts.values() for node in ast.walk(parse(text))):
            if isinstance(node, ast.ClassDef):
                self._bases[node.name] = list(map(last_name, node.bases))
            elif isinstance(node, ast.FunctionDef) and (name := last_name(node.returns)):
                self._makers[node.name] = name

    def ancestors(self, name: str) -> set[str]:
        """A class of errors and all that it descends from; empty if it is none."""
        if name in self._bases:
            above = {each for base in self._bases[name] for each in self.ancestors(base)}
            return above and {name, *above}
        kind = getattr(builtins, name, None)
        is_error = isinstance(kind, type) and issubclass(kind, BaseException)
        return {each.__name__ for each in kind.__mro__[:-1]} if is_error else set()

    def find_raised(self, node: ast.Raise) -> str:
        """Name of the class that is raised; empty if it cannot be told, as of ``raise error``."""
        name = last_name(node.exc) if isinstance(node.exc, ast.Call) else ""
        return next((each for each in (name, self._makers.get(name, "")) if self.ancestors(each)), "")


def raises(node: ast.AST, errors: Errors, caught: frozenset[str] = frozenset()) -> Iterator[str]:
    """Classes that leave a piece of code, without those that it catches and those of functions inside of it."""
    if isinstance(node, ast.Raise):
        name = errors.find_raised(node)
        if name and not errors.ancestors(name) & caught:
            yield name
    for field, value in ast.iter_fields(node):
        handled = caught
        if isinstance(node, ast.Try) and field == "body":
            kinds = [handler.type for handler in node.handlers]
            parts = [part for kind in kinds for part in (kind.elts if isinstance(kind, ast.Tuple) else [kind])]
            handled |= {last_name(part) for part in parts}
        for inner in value if isinstance(value, list) else [value]:
            if isinstance(inner, ast.AST) and not isinstance(inner, ast.FunctionDef | ast.Lambda | ast.ClassDef):
                yield from raises(inner, errors, handled)


def find_undocumented(text: str, errors: Errors) -> Iterator[str]:
    for function in (node for node in ast.walk(parse(text)) if isinstance(node, ast.FunctionDef)):
        docstring = ast.get_docstring(function)
        if docstring is None or (function.name.startswith("_") and not function.name.startswith("__")):
            continue
        section = RAISES.search(docstring)
        documented = set(re.findall(r"^ +(\w+): ", section[1], flags=re.MULTILINE)) if section else set()
        for name in dict.fromkeys(raises(function, errors)):
            if not errors.ancestors(name) & documented:
                yield f"{function.name} raises {name}"


def test_raises_are_documented() -> None:
    errors = Errors(MODULES)
    found = {
        str(path.relative_to(ROOT)): list(find_undocumented(MODULES[path], errors)) for path in list_public_modules()
    }
    assert {path: each for path, each in found.items() if each} == {}
