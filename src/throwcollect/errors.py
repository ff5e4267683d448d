"""All errors that throwcollect raises on purpose, and checks of arguments of functions that other programs call.

The exit code of a command is that of the class; `throwcollect.extras` has one further error, for a missing package.

A message names, in this order: where the problem is, what is wrong and which value was given; what would be right;
the evidence; and what to try.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from enum import Enum
from operator import index
from pathlib import Path
from typing import Any, TypeVar

from throwcollect.wording import suggest


class ThrowcollectError(Exception):
    """Root of all errors raised on purpose.

    Args:
        message: Place and nature of the problem, in one line.
        expected: What would have been right.
        evidence: What was observed, such as the tail of a log.
        hint: One command or one edit that helps.
    """

    exit_code = 1

    def __init__(
        self, message: str, *, expected: str | None = None, evidence: str | None = None, hint: str | None = None
    ) -> None:
        self.message = message
        self.expected = expected
        self.evidence = evidence
        self.hint = hint
        super().__init__(message)

    def __reduce__(self) -> tuple[Any, ...]:
        # Python would call `__init__` with the message alone, which is not what each of these classes takes; then an
        # error of another process would not arrive.
        return type(self).__new__, (type(self), *self.args), self.__dict__

    @property
    def one_line(self) -> str:
        """The message and the hint, for places where only one line fits."""
        return "; try: ".join(filter(None, [self.message, self.hint]))

    def __str__(self) -> str:
        return self._with_facts(self.message)

    def _with_facts(self, first: str) -> str:
        lines = [first]
        for label, text in (("expected", self.expected), ("evidence", self.evidence), ("try", self.hint)):
            if text:
                lines.append(f"  {label}: " + text.replace("\n", "\n    "))
        return "\n".join(lines)


@dataclass(frozen=True)
class Problem:
    """One thing that is wrong in a configuration."""

    message: str
    """What is wrong, which value was given and what would be right."""
    key: str = ""
    """Dotted path of the key, or the name of an argument."""
    path: Path | None = None
    """File that holds the key; None when it came from the command line."""
    line: int | None = None
    """Line in that file, counted from 1."""

    def __str__(self) -> str:
        where = str(self.path) if self.path else ""
        if where and self.line is not None:
            where += f":{self.line}"
        return ": ".join(part for part in (where, self.key, self.message) if part)


class ConfigError(ThrowcollectError):
    """The request is wrong; nothing has been started.

    Args:
        problems: All problems that were found, at least one; or a single problem as a sentence.
    """

    exit_code = 2

    def __init__(
        self, problems: str | Sequence[Problem], *, expected: str | None = None, hint: str | None = None
    ) -> None:
        self.problems = [Problem(problems)] if isinstance(problems, str) else list(problems)
        super().__init__("\n".join(map(str, self.problems)), expected=expected, hint=hint)


class PlanError(ConfigError):
    """The sweep yields no trial that could be run."""


class NotFoundError(ConfigError):
    """The request names something that does not exist."""


class ConflictError(ConfigError):
    """The request does not fit the state of the thing that it names."""


class WorkerError(ThrowcollectError):
    """A process of the run could not be started or was lost for good."""

    exit_code = 3


class LossError(ThrowcollectError):
    """A dataset was collected or mended to its end, but trials of it are lost or doubtful."""

    exit_code = 5


class DatasetError(ThrowcollectError):
    """A dataset is missing, torn or contradicts itself.

    Args:
        problem: What is wrong, in one line.
        path: The damaged file or directory; None if only the caller knows it.
        place: Place in that file, such as ``byte 17``; empty for the file as a whole.
    """

    exit_code = 4

    def __init__(
        self,
        problem: str,
        *,
        path: Path | None = None,
        place: str = "",
        expected: str | None = None,
        evidence: str | None = None,
        hint: str | None = None,
    ) -> None:
        self.problem = problem
        self.path = path
        self.place = place
        message = ": ".join([*filter(None, ("" if path is None else str(path), place)), problem])
        super().__init__(message, expected=expected, evidence=evidence, hint=hint)

    @property
    def details(self) -> str:
        """The message without file and place, for reports that have separate columns for file and place."""
        return self._with_facts(self.problem)

    def locate(self, path: Path | None = None, place: str = "") -> DatasetError:
        """Return the same error with file and place, for a caller that knows where the bytes came from.

        `place` is that of the bytes in the file; it comes before the place of the error in the bytes.
        """
        # An error makes its message when it is made, so another place needs another error.
        whole = ": ".join(filter(None, (place, self.place)))
        facts = {"expected": self.expected, "evidence": self.evidence, "hint": self.hint}
        return type(self)(self.problem, path=path or self.path, place=whole, **facts)


class ForeignPlanError(DatasetError):
    """A plan was made for a configuration other than the one in its directory."""


class OutputError(ThrowcollectError):
    """The command is done, but its result could not be written to standard output."""

    exit_code = 6


class UnreachableError(ThrowcollectError):
    """The router of a run does not answer; it may be about to be started again."""

    exit_code = 7


class MemberError(ThrowcollectError):
    """A robot, engine, task or other part of another package fails where it is used; the message names that package."""


class RequestError(ThrowcollectError):
    """A running simulation cannot do what a client asks; the client gets the reason, and the simulation goes on.

    Args:
        reason: Name of the result code in the interface definitions, such as ``NAME_INVALID``.
        message: What was asked for and what is wrong with it, in one line.
    """

    def __init__(self, reason: str, message: str, *, expected: str | None = None, hint: str | None = None) -> None:
        self.reason = reason
        super().__init__(message, expected=expected, hint=hint)


class Interrupted(ThrowcollectError):
    """Stopped by the user; finished episodes are on disk."""

    exit_code = 130


_Word = TypeVar("_Word", bound=Enum)


def refuse_argument(
    argument: str, problem: str, *, expected: str | None = None, hint: str | None = None
) -> ConfigError:
    """Make the error that an argument is wrong."""
    return ConfigError([Problem(problem, argument)], expected=expected, hint=hint)


def check_bounds(argument: str, given: int, *, least: int, most: int | None = None) -> None:
    """Reject an integer that is not from `least` to `most`; None for no upper bound."""
    if index(given) < least or (most is not None and given > most):
        bounds = f"{least} or more" if most is None else f"{least} to {most}"
        raise refuse_argument(argument, f"got {given}", expected=bounds)


def read_word(argument: str, given: str, words: type[_Word]) -> _Word:
    """Find the member of an enumeration that a word stands for."""
    try:
        return words(given)
    except ValueError:
        meant = suggest(given, [each.value for each in words])
        raise refuse_argument(argument, f"{given!r}{meant}") from None
