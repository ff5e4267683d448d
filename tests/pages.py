"""Pages of the documents, section by section, for tests that execute them."""

import re
from pathlib import Path

DOCS = Path(__file__).parents[1] / "docs"


def read_section(page: str, heading: str) -> str:
    """Read what stands below a heading of a page, up to the next heading that is not below it."""
    lines: list[str] = []
    level, fenced = 0, False
    for line in (DOCS / page).read_text(encoding="utf-8").splitlines(keepends=True):
        fenced ^= line.startswith("```")
        marks, _, words = line.partition(" ")
        if not fenced and re.fullmatch("#+", marks):
            if words.strip() == heading:
                level = len(marks)
                continue
            if len(marks) <= level:
                break
        if level:
            lines.append(line)
    assert lines, f"docs/{page} has no section {heading!r}"
    return "".join(lines)


def find_blocks(language: str, text: str) -> list[str]:
    """Find the contents of all fenced blocks of a language."""
    return re.findall(rf"^```{language}\n(.*?)^```", text, flags=re.DOTALL | re.MULTILINE)
