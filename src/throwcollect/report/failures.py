"""Why throws did not land, with reasons that differ only in their numbers taken as one."""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import dataclass

_NUMBER = re.compile(r"(?<![\w.])-?\d[\d.]*(?:e[-+]?\d+)?")
_EXAMPLES = 5


@dataclass(frozen=True)
class Failure:
    """Trials that ended alike.

    Attributes:
        outcome: How.
        pattern: Why, with ``#`` in place of numbers that differ between them; one of the reasons if none does.
        count: How many.
        examples: Numbers of the first of them.
    """

    outcome: str
    pattern: str
    count: int
    examples: tuple[int, ...]


def failures(rows: Iterable[tuple[int, str, str | None]]) -> tuple[Failure, ...]:
    """Failures by outcome and reason, most frequent first.

    Args:
        rows: Trial, outcome and reason; those without a reason did not fail.
    """
    groups: dict[tuple[str, str], tuple[set[str], list[int]]] = {}
    for trial, outcome, reason in rows:
        if reason is not None:
            reasons, trials = groups.setdefault((outcome, _NUMBER.sub("#", reason)), (set(), []))
            reasons.add(reason)
            trials.append(trial)
    found = [
        Failure(outcome, pattern if len(reasons) > 1 else next(iter(reasons)), len(trials), tuple(trials[:_EXAMPLES]))
        for (outcome, pattern), (reasons, trials) in groups.items()
    ]
    return tuple(sorted(found, key=lambda failure: (-failure.count, failure.outcome, failure.pattern)))
