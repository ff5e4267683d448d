"""Each link of the documents leads to a file of the repository that exists, and to a heading in it."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).parents[2]
DOCUMENTS = [*ROOT.glob("*.md"), *(ROOT / "docs").rglob("*.md"), *(ROOT / "packaging").rglob("*.md")]
LINK = re.compile(r"\]\((?!\w+:)([^)#\s]*)(?:#([^)\s]*))?\)")
CODE = re.compile(r"^(```|~~~).*?^\1|`[^`\n]*`", flags=re.DOTALL | re.MULTILINE)


def list_anchors(text: str) -> set[str]:
    """The anchors of headings, as GitHub makes them: a repeated one has its number behind it."""
    text = re.sub(r"^```.*?^```", "", text, flags=re.DOTALL | re.MULTILINE)
    seen: Counter[str] = Counter()
    anchors = set()
    for heading in re.findall(r"^#+ +(.*)$", text, flags=re.MULTILINE):
        words = re.sub(r"\[([^]]*)\]\([^)]*\)", r"\1", heading).strip().lower()
        slug = re.sub(r"[^\w\- ]", "", words).replace(" ", "-")
        anchors.add(f"{slug}-{seen[slug]}" if seen[slug] else slug)
        seen[slug] += 1
    return anchors


def find_dead_links(path: Path) -> Iterator[str]:
    """Links of a document that lead nowhere."""
    text = path.read_text(encoding="utf-8")
    for name, anchor in LINK.findall(CODE.sub("", text)):
        target = path.parent / name if name else path
        if not target.exists():
            yield name
        elif anchor and (target.suffix != ".md" or anchor not in list_anchors(target.read_text(encoding="utf-8"))):
            yield f"{name}#{anchor}"


def test_links_lead_to_files_and_headings() -> None:
    dead = {str(path.relative_to(ROOT)): list(find_dead_links(path)) for path in DOCUMENTS}
    assert {path: links for path, links in dead.items() if links} == {}
