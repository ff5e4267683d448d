"""The public names of throwcollect: their list, their documentation, and the cost of importing them."""

import ast
import inspect
import re
import subprocess
import sys
from pathlib import Path
from types import ModuleType

import pytest

import throwcollect
from throwcollect import runs

ROOT = Path(__file__).parents[2]
OWN = "throwcollect:"
"""Prefix of a module that is public as a whole."""
DOCUMENTS = [ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md"))]


def test_dir_and_the_documentation_list_the_public_names() -> None:
    described = re.findall(r"^\| `(\w+)`", (ROOT / "docs" / "python.md").read_text(encoding="utf-8"), re.MULTILINE)
    assert dir(throwcollect) == throwcollect.__all__ == sorted(throwcollect.__all__)
    assert sorted(described) == throwcollect.__all__


@pytest.mark.parametrize("face", [throwcollect, runs], ids=lambda face: face.__name__)
def test_type_checkers_see_the_same_names_as_lazy_imports(face: ModuleType) -> None:
    tree = ast.parse(inspect.getsource(face))
    (block,) = (each for each in tree.body if isinstance(each, ast.If))
    imported = {
        alias.asname or alias.name: f"{statement.module}:{alias.name}".removeprefix("throwcollect.").removeprefix(OWN)
        for statement in block.body
        if isinstance(statement, ast.ImportFrom)
        for alias in statement.names
    }
    # A module of a room is the only place with a dot and without a colon.
    assert imported == {
        name: place if ":" in place else ":".join(place.rsplit(".", 1)) for name, place in face._PLACES.items()
    }


@pytest.mark.parametrize("face", [throwcollect, runs], ids=lambda face: face.__name__)
def test_every_public_name_can_be_imported_and_has_a_docstring(face: ModuleType) -> None:
    assert len(face.__all__) > 10
    for name in face.__all__:
        if name != "__version__":
            taken = getattr(face, name)
            assert inspect.isclass(taken) or inspect.isroutine(taken) or inspect.ismodule(taken), name
            assert taken.__doc__, name


def test_importing_throwcollect_loads_no_other_package() -> None:
    script = (
        "import sys; before = set(sys.modules); import throwcollect; "
        "print(*sorted(name for name in set(sys.modules) - before "
        "if name.partition('.')[0] not in sys.stdlib_module_names))"
    )
    said = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
    assert said.stdout.split() == ["throwcollect", "throwcollect.version"]


def test_documents_import_from_no_inner_module() -> None:
    # Packages with tasks of their own are made of the classes that these are derived from; a test runs that page.
    inside = [
        f"{path.name}: {line}"
        for path in DOCUMENTS
        if path.name != "robots.md"
        for line in path.read_text(encoding="utf-8").splitlines()
        if re.match(r"\s*(from throwcollect\.|import throwcollect\.)", line)
    ]
    assert inside == []
