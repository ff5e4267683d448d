"""Functions that other rooms import have precise types, as a dictionary of anything hides which facts it holds."""

from __future__ import annotations

import ast
from collections.abc import Iterator, Mapping
from pathlib import Path

from tests.architecture.parsing import parse

SOURCE = Path(__file__).parents[2] / "src"
LOOSE = {f"{kind}[str, {value}]" for kind in ("dict", "Mapping") for value in ("Any", "object")}
DOCUMENTS = {"as_dict", "to_yaml", "bag_information", "Qos.profile", "ValueShape.node", "Document.override"}
"""Functions whose result becomes JSON or YAML at once, so that it may be a dictionary of anything."""


def room_of(module: str) -> str:
    return ".".join(module.split(".")[:2])


def parse_modules() -> dict[str, ast.Module]:
    return {
        ".".join(path.relative_to(SOURCE).with_suffix("").parts): parse(path.read_text(encoding="utf-8"))
        for path in sorted(SOURCE.rglob("*.py"))
    }


def find_imported_elsewhere(modules: Mapping[str, ast.Module]) -> set[tuple[str, str]]:
    """Names that a room other than their own imports, with the modules that they come from."""
    return {
        (node.module, name.name)
        for module, tree in modules.items()
        for node in ast.walk(tree)
        if isinstance(node, ast.ImportFrom) and node.module and room_of(node.module) != room_of(module)
        for name in node.names
    }


def is_loose(annotation: ast.expr | None) -> bool:
    return annotation is not None and any(ast.unparse(part) in LOOSE for part in ast.walk(annotation))


def loose_names(definition: ast.stmt, owner: str = "") -> Iterator[str]:
    """Public functions and fields of a definition that take, give or hold a dictionary of anything."""
    if isinstance(definition, ast.ClassDef):
        for member in definition.body:
            yield from loose_names(member, f"{definition.name}.")
    elif isinstance(definition, ast.FunctionDef) and not definition.name.startswith("_"):
        given = definition.args
        arguments = (*given.posonlyargs, *given.args, *given.kwonlyargs, given.vararg, given.kwarg)
        if any(map(is_loose, (definition.returns, *(each.annotation for each in arguments if each)))):
            yield f"{owner}{definition.name}"
    elif isinstance(definition, ast.AnnAssign) and is_loose(definition.annotation):
        name = ast.unparse(definition.target)
        if not name.startswith("_"):
            yield f"{owner}{name}"


def is_document(name: str) -> bool:
    return name in DOCUMENTS or name.rpartition(".")[2] in DOCUMENTS


def test_functions_that_other_rooms_import_have_precise_types() -> None:
    modules = parse_modules()
    shared = find_imported_elsewhere(modules)
    found = {
        f"{module}: {name}"
        for module, tree in modules.items()
        for definition in tree.body
        if (module, getattr(definition, "name", "")) in shared
        for name in loose_names(definition)
        if not is_document(name)
    }
    assert found == set()
