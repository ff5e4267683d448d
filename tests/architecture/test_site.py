"""The site is built without warnings and loads nothing from other servers; the citation names this version."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import pytest
from ruamel.yaml import YAML

from throwcollect.version import __version__

ROOT = Path(__file__).parents[2]


def test_every_page_is_in_the_navigation() -> None:
    _, _, navigation = (ROOT / "mkdocs.yml").read_text(encoding="utf-8").partition("\nnav:\n")
    pages = set(re.findall(r": (\S+\.md)$", navigation, flags=re.MULTILINE))
    assert {path.name for path in (ROOT / "docs").glob("*.md")} <= pages


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The site, as `make docs` builds it."""
    path = tmp_path_factory.mktemp("site")
    command = [sys.executable, "-m", "mkdocs", "build", "--strict", "--site-dir", str(path)]
    built = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, timeout=120, check=False)
    assert built.returncode == 0, built.stderr
    return path


def test_pages_from_outside_of_docs_link_into_the_site(site: Path) -> None:
    assert 'href="configuration.html"' in (site / "index.html").read_text(encoding="utf-8")
    assert 'href="docs/' not in (site / "index.html").read_text(encoding="utf-8")
    decision = (site / "decisions" / "0021-urdf-of-components.html").read_text(encoding="utf-8")
    assert 'href="../contributing.html"' in decision
    decisions = (site / "decisions" / "index.html").read_text(encoding="utf-8")
    for path in (ROOT / "docs" / "decisions").glob("*.md"):
        assert f'href="{path.stem}.html"' in decisions


def test_pages_load_nothing_from_other_servers(site: Path) -> None:
    loaded = re.compile(
        r"<(?:script|img|iframe)[^>]* src=\"?(?:https?:)?//[^>]*>|<link[^>]* href=\"?(?:https?:)?//[^>]*>"
    )
    for page in site.rglob("*.html"):
        assert loaded.findall(page.read_text(encoding="utf-8")) == [], page


def test_the_citation_names_this_version() -> None:
    citation = YAML(typ="safe").load(ROOT / "CITATION.cff")
    assert citation["version"] == __version__
    assert {"cff-version", "message", "title", "authors"} <= citation.keys()


def test_the_distribution_and_the_images_that_are_named_have_this_version() -> None:
    assert f'\nversion = "{__version__}"\n' in (ROOT / "pyproject.toml").read_text(encoding="utf-8")
    named = {
        f"{path.name}: {version}"
        for path in [*(ROOT / "compose").iterdir(), *(ROOT / "docs").glob("*.md")]
        for version in re.findall(r"\bthrowcollect:(\d[\w.]*)", path.read_text(encoding="utf-8"))
        if version != __version__
    }
    assert named == set()
