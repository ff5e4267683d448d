"""What mkdocs does besides for the documentation site: it takes in pages that do not lie in `docs/`.

README, CONTRIBUTING and CHANGELOG stay where everybody looks for them. Links between pages are written for the
repository, so those that lead out of `docs/`, or from outside into it, are changed to where their targets are on the
site.
"""

from __future__ import annotations

import posixpath
import re
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from mkdocs.config.defaults import MkDocsConfig
    from mkdocs.structure.files import Files
    from mkdocs.structure.pages import Page

ROOT = Path(__file__).parents[1]
PAGES = {
    "README.md": "index.md",
    "CONTRIBUTING.md": "contributing.md",
    "CHANGELOG.md": "changelog.md",
    "packaging/ros_interfaces/README.md": "ros_interfaces.md",
    "docs/decisions": "decisions/index.md",
}
"""Pages of the site by what they are made of, seen from the root of the repository."""
SOURCES = {page: source for source, page in PAGES.items() if source.endswith(".md")}
LINK = re.compile(r"(?<=\]\()(?!\w+:)([^)#\s]+)")
"""Paths in links and pictures; what follows `#` stays."""


def rewrite_links(text: str, page: str) -> str:
    """The Markdown of a page of the site, its links as the site needs them instead of the repository.

    Links to what is not on the site stay as they are, so that mkdocs warns of them.
    """
    source = SOURCES.get(page, f"docs/{page}")

    def rewrite(link: re.Match[str]) -> str:
        target = posixpath.normpath(posixpath.join(posixpath.dirname(source), link[0]))
        if target not in PAGES and not target.startswith("docs/"):
            return link[0]
        return posixpath.relpath(PAGES.get(target, target.removeprefix("docs/")), posixpath.dirname(page) or ".")

    return LINK.sub(rewrite, text)


def list_decisions() -> str:
    """A page that leads to all decisions, by their headings."""
    paths = sorted((ROOT / "docs" / "decisions").glob("*.md"))
    headings = [(path.read_text(encoding="utf-8").splitlines()[0].removeprefix("# "), path.name) for path in paths]
    items = [f"- {name[:4]}: [{heading}]({name})" for heading, name in headings]
    return "\n".join(["# Decisions", "", "Why things are as they are, one page a question.", "", *items, ""])


def on_files(files: Files, config: MkDocsConfig) -> Files:
    """Add the pages that do not lie in `docs/`."""
    from mkdocs.structure.files import File

    for source, page in PAGES.items():
        path = ROOT / source
        text = list_decisions() if path.is_dir() else path.read_text(encoding="utf-8")
        files.append(File.generated(config, page, content=text))
    return files


def on_page_markdown(markdown: str, *, page: Page, **_: object) -> str:
    """Change links before mkdocs looks where they lead."""
    return rewrite_links(markdown, page.file.src_uri)
