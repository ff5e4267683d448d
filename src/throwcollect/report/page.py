"""The page: its sections in order, filled into ``page.html``, with everything that it needs inside."""

from __future__ import annotations

import json
from collections.abc import Iterable
from html import escape
from importlib.resources import files
from string import Template
from typing import Any

from plotly.offline import get_plotlyjs

from throwcollect.report.dataset_facts import Facts
from throwcollect.report.heading import heading
from throwcollect.report.panels import Panel, Section
from throwcollect.report.sections import sections
from throwcollect.version import __version__


def page(facts: Facts) -> str:
    """HTML of a report; equal facts give equal pages.

    Args:
        facts: What it says.
    """
    shown = sections(facts)
    template = Template(files(__package__).joinpath("page.html").read_text(encoding="utf-8"))
    return template.substitute(
        name=escape(facts.info.name),
        trials=facts.info.trials,
        version=escape(__version__),
        heading=heading(facts, shown),
        sections="\n".join(map(_section, shown)),
        plotly=get_plotlyjs(),
    )


def _section(section: Section) -> str:
    blocks = "\n".join(_block(block, section.key) for block in section.blocks)
    blocks = f'<div class="blocks">\n{blocks}\n</div>\n' if blocks else ""
    text = f"<p>{section.text}</p>" if section.text else ""
    return f'<section id="{section.key}">\n<h2>{escape(section.title)}</h2>\n{text}\n{blocks}</section>'


def _block(block: str | Panel | tuple[Panel, ...], key: str) -> str:
    if isinstance(block, str):
        return block
    if isinstance(block, Panel):
        return _panel(block, key)
    kind = "grid small" if all(panel.small for panel in block) else "grid"
    return f'<div class="{kind}">\n{_joined(_panel(panel, key) for panel in block)}\n</div>'


def _panel(panel: Panel, key: str) -> str:
    name = f"{key}-{panel.key}"
    caption = f"<h3>{escape(panel.title)}</h3>" + (f"<p>{panel.text}</p>" if panel.text else "")
    width = f' style="min-width: {panel.width_px}px"' if panel.width_px else ""
    return (
        f'<figure>\n<figcaption>{caption}</figcaption>\n<div class="scroll"><div class="plot" id="{name}"{width} '
        f'role="img" aria-label="{escape(panel.title)}"></div></div>\n'
        f'<script type="application/json" id="{name}-data">{_json(panel.figure.to_dict())}</script>\n</figure>'
    )


def _json(figure: dict[str, Any]) -> str:
    # The theme is the page's own.
    figure["layout"].pop("template", None)
    text = json.dumps(figure, separators=(",", ":"), allow_nan=False, default=list)
    # A script element ends at the first "</script", wherever it stands.
    return text.replace("&", "\\u0026").replace("<", "\\u003c").replace(">", "\\u003e")


def _joined(parts: Iterable[str]) -> str:
    return "\n".join(parts)
