"""Groups trials that failed by their reasons; reasons that differ only in numbers count as the same."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

from throwcollect.wording import blank_numbers

_EXAMPLES = 5


@dataclass(frozen=True)
class FailureGroup:
    """A group of trials with the same outcome and, but for numbers, the same reason.

    Attributes:
        pattern: Their reason; if its numbers differ between the trials, ``#`` stands in place of each number.
        examples: Numbers of the first of these trials.
    """

    outcome: str
    pattern: str
    count: int
    examples: tuple[int, ...]


def group_failures(rows: Iterable[tuple[int, str, str | None]]) -> tuple[FailureGroup, ...]:
    """Group trial, outcome and reason of each row, most frequent groups first; trials without a reason did not fail."""
    groups: dict[tuple[str, str], list[tuple[int, str]]] = {}
    for trial, outcome, reason in rows:
        if reason is not None:
            groups.setdefault((outcome, blank_numbers(reason)), []).append((trial, reason))
    failures = []
    for (outcome, pattern), members in groups.items():
        trials, reasons = zip(*members, strict=True)
        reason = pattern if len(set(reasons)) > 1 else reasons[0]
        failures.append(FailureGroup(outcome, reason, len(trials), trials[:_EXAMPLES]))
    return tuple(sorted(failures, key=lambda failure: (-failure.count, failure.outcome, failure.pattern)))
