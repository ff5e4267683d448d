"""A page as a browser reads it."""

from __future__ import annotations

import json
from html.parser import HTMLParser
from typing import Any

from throwcollect.publish.report.contents import Panel, ReportSection

VOID = {"meta", "link", "br"}


class Page(HTMLParser):
    """What a browser would find in a page; whether its elements are nested well."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.open: list[str] = []
        self.elements: list[tuple[str, dict[str, str | None]]] = []
        self.texts: list[tuple[str, str]] = []
        self.feed(text)
        self.close()
        assert self.open == []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.elements.append((tag, dict(attrs)))
        if tag not in VOID:
            self.open.append(tag)

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        self.texts.append((self.open[-1] if self.open else "", data))

    def find_elements(self, tag: str) -> list[dict[str, str | None]]:
        return [attributes for name, attributes in self.elements if name == tag]

    @property
    def plots(self) -> dict[str, dict[str, Any]]:
        """Figures by their name; fails where the JSON does."""
        scripts = [
            attributes for attributes in self.find_elements("script") if attributes.get("type") == "application/json"
        ]
        bodies = [text for tag, text in self.texts if tag == "script" and text.startswith('{"data":')]
        assert len(scripts) == len(bodies)
        return {
            str(attributes["id"]).removesuffix("-data"): json.loads(body)
            for attributes, body in zip(scripts, bodies, strict=True)
        }

    @property
    def words(self) -> str:
        return " ".join(" ".join(text.split()) for tag, text in self.texts if tag not in ("script", "style"))


def list_panels(section: ReportSection) -> list[Panel]:
    """All panels of a section, in order."""
    return [panel for block in section.blocks if isinstance(block, tuple) for panel in block]
