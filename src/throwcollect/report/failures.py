"""Why throws did not land, with reasons that differ only in their numbers taken as one."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

from throwcollect.wording import blank_numbers

_EXAMPLES = 5


@dataclass(frozen=True)
class Failure:
    """Trials with one outcome and, but for numbers, one reason.

    Attributes:
        outcome: Their outcome.
        pattern: Their reason, with ``#`` in place of numbers if these differ between the trials.
        count: Number of trials.
        examples: Numbers of the first of these trials.
    """

    outcome: str
    pattern: str
    count: int
    examples: tuple[int, ...]


def group_failures(rows: Iterable[tuple[int, str, str | None]]) -> tuple[Failure, ...]:
    """Group trials by outcome and reason, most frequent first.

    Args:
        rows: Trial, outcome and reason; those without a reason did not fail.
    """
    groups: dict[tuple[str, str], list[tuple[int, str]]] = {}
    for trial, outcome, reason in rows:
        if reason is not None:
            groups.setdefault((outcome, blank_numbers(reason)), []).append((trial, reason))
    failures = []
    for (outcome, pattern), members in groups.items():
        trials, reasons = zip(*members, strict=True)
        said = pattern if len(set(reasons)) > 1 else reasons[0]
        failures.append(Failure(outcome, said, len(trials), trials[:_EXAMPLES]))
    return tuple(sorted(failures, key=lambda failure: (-failure.count, failure.outcome, failure.pattern)))
