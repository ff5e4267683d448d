"""The page names only its own files, none is missing, and its libraries are unchanged."""

from __future__ import annotations

import hashlib
import re
from html.parser import HTMLParser
from pathlib import Path

import pytest

from throwcollect.serve import app

PAGE = Path(app.__file__).parent / "page"
VENDOR = PAGE / "vendor"
OWN = sorted(path for path in PAGE.iterdir() if path.is_file())
SCRIPTS = sorted(PAGE.rglob("*.js"))
_HOST = re.compile(r"(?:\b(?:https?|wss?):|[\"'(])//[\w.-]+")
_NAMESPACES = ("http://www.w3.org",)
_IMPORT = re.compile(r"^(?:import\b|}\s*from\b)[^;]*?[\"']([^\"']+)[\"'];", re.MULTILINE)


class _Tags(HTMLParser):
    def __init__(self) -> None:
        super().__init__()
        self.found: list[tuple[str, dict[str, str | None]]] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.found.append((tag, dict(attrs)))


@pytest.fixture(scope="module")
def tags() -> list[tuple[str, dict[str, str | None]]]:
    parser = _Tags()
    parser.feed((PAGE / "index.html").read_text(encoding="utf-8"))
    return parser.found


def test_libraries_match_their_recorded_digests() -> None:
    lines = (VENDOR / "SHA256SUMS").read_text().splitlines()
    wanted = {path: digest for digest, path in (line.split(maxsplit=1) for line in lines)}
    found = {
        str(path.relative_to(VENDOR)): hashlib.sha256(path.read_bytes()).hexdigest()
        for path in VENDOR.rglob("*")
        if path.is_file() and path.name != "SHA256SUMS"
    }
    assert found == wanted


def test_each_library_has_its_licence() -> None:
    assert {path.name for path in VENDOR.iterdir() if path.is_dir()} == {"three", "urdf-loader", "uplot"}
    assert all((path / "LICENSE").is_file() for path in VENDOR.iterdir() if path.is_dir())


def find_hosts(text: str) -> list[str]:
    """Other hosts that a text names, each with its scheme."""
    return [host for found in _HOST.findall(text) if (host := found.strip("\"'(")) not in _NAMESPACES]


def find_imports(path: Path) -> list[str]:
    """What a module imports."""
    return _IMPORT.findall(path.read_text(encoding="utf-8"))


@pytest.mark.parametrize("path", OWN, ids=lambda path: path.name)
def test_no_file_of_the_page_names_another_host(path: Path) -> None:
    assert find_hosts(path.read_text(encoding="utf-8")) == []


@pytest.mark.parametrize("path", SCRIPTS, ids=lambda path: path.name)
def test_modules_import_only_existing_files(path: Path) -> None:
    for target in find_imports(path):
        assert target.startswith("."), f"{path.name} imports {target}, and browsers find paths alone"
        assert (path.parent / target).is_file(), f"{path.name} imports {target}"


def test_the_page_refers_only_to_existing_files(tags: list[tuple[str, dict[str, str | None]]]) -> None:
    references = [
        value
        for _, attributes in tags
        for name, value in attributes.items()
        if name in ("src", "href") and value and not value.startswith("#")
    ]
    assert "main.js" in references
    assert [value for value in references if not (PAGE / value).is_file()] == []


def test_the_page_has_no_inline_scripts_that_the_policy_forbids(tags: list[tuple[str, dict[str, str | None]]]) -> None:
    assert all(attributes.get("src") for tag, attributes in tags if tag == "script"), "no script may be in the page"
    assert not [name for _, attributes in tags for name in attributes if name.startswith("on")]


def test_the_page_has_the_elements_that_its_scripts_look_for(tags: list[tuple[str, dict[str, str | None]]]) -> None:
    ids = [attributes["id"] for _, attributes in tags if "id" in attributes]
    assert len(ids) == len(set(ids))
    asked = {
        name for path in OWN for name in re.findall(r"(?<![.\w])get\(\"([\w-]+)\"\)", path.read_text(encoding="utf-8"))
    }
    assert {"components", "instances"} <= asked
    assert asked - set(ids) == set()
