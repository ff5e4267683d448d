"""The head of the page: name, key numbers, shares of outcomes, contents."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape

from throwcollect.report.dataset_facts import Facts
from throwcollect.report.outcomes import in_words, style_of
from throwcollect.report.panels import Section


def heading(facts: Facts, sections: Sequence[Section]) -> str:
    """HTML of the page's head.

    Args:
        facts: What the page says.
        sections: What is below.
    """
    info = facts.info
    parts = [f"{info.trials:,} simulated throw{'s' if info.trials > 1 else ''} of a ball by the humanoid robot Talos"]
    if finished := facts.provenance.get("finished"):
        parts.append(f"finished on {escape(finished[:10])}")
    links = "".join(f'<a href="#{section.key}">{escape(section.short)}</a>' for section in sections)
    tiles = "".join(f"<li><b>{value}</b><span>{label}</span></li>" for label, value in _tiles(facts))
    return (
        f'<h1>{escape(info.name)}</h1>\n<p class="lead">{", ".join(parts)}.</p>\n<ul class="tiles">{tiles}</ul>\n'
        f"{_outcome_bar(facts)}\n<nav>{links}</nav>"
    )


def _tiles(facts: Facts) -> list[tuple[str, str]]:
    info, landings = facts.info, facts.landings
    tiles = [("throws planned", f"{info.trials:,}"), ("landed as planned", share(facts.outcomes.landed, info.trials))]
    if len(landings):
        distance, speed = landings.distance_m, landings.speed_mps
        tiles += [
            ("landing distance", f"{distance.min():.2f}–{distance.max():.2f} m"),
            ("release speed", f"{speed.min():.2f}–{speed.max():.2f} m/s"),
        ]
    return [*tiles, ("of simulated time", _duration(info.duration_s)), ("on disk", _bytes(info.size_bytes))]


def _outcome_bar(facts: Facts) -> str:
    bars, keys = [], []
    for name, count in facts.outcomes.counts.items():
        colour = f'style="background: {style_of(name).colour}'
        bars.append(f'<i {colour}; flex: {count} 0 0"></i>')
        text = f"{escape(in_words(name))} {count:,} ({share(count, facts.info.trials)})"
        keys.append(f'<li><i {colour}"></i>{text}</li>')
    bar = f'<div class="bar" role="img" aria-label="shares of outcomes">{"".join(bars)}</div>'
    return f'{bar}\n<ul class="key">{"".join(keys)}</ul>'


def share(count: int, total: int) -> str:
    """A share in percent; 100 % and 0 % mean all and none."""
    percent = 100 * count / total
    if 0 < count < total:
        percent = min(max(percent, 0.1), 99.9)
    return f"{percent:.3g} %" if percent in (0, 100) else f"{percent:.1f} %"


def _duration(seconds: float) -> str:
    if seconds < 120:
        return f"{seconds:.0f} s"
    return f"{seconds / 60:.1f} min" if seconds < 7200 else f"{seconds / 3600:,.1f} h"


def _bytes(count: int) -> str:
    for unit, size in (("GB", 1e9), ("MB", 1e6)):
        if count >= size:
            return f"{count / size:.1f} {unit}"
    return f"{count / 1e3:.0f} kB"
