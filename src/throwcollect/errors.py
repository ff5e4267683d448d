"""Every error that throwcollect raises on purpose, as a tree.

::

    ThrowcollectError                exit 1
    ├── ConfigError                  exit 2   the request is wrong; nothing has been started
    │   ├── PlanError                exit 2   the sweep yields no trial that could be run
    │   ├── NotFoundError            exit 2   what is named does not exist
    │   └── ConflictError            exit 2   it does, but in a state that does not allow what is asked for
    ├── MissingExtraError            exit 2   a package that an extra brings is not installed (`throwcollect.extras`)
    ├── MissingLibraryError          exit 2   a library of the system is missing that such a package loads (likewise)
    ├── WorkerError                  exit 3   a process of the run could not be started or was lost for good
    ├── LossError                    exit 5   a dataset is there, but trials of it are lost or doubtful
    ├── DatasetError                 exit 4   a dataset is missing, torn or contradicts itself
    │   └── ForeignPlanError         exit 4   a plan was made for another configuration
    ├── OutputError                  exit 6   all is done, but the result could not be printed
    ├── RequestError                 exit 1   what a client asks of a running simulation cannot be done
    └── Interrupted                  exit 130 stopped by the user; what is finished is on disk

A message has up to five facts, in this order: where, what was wrong and what was got; what would be right; the
evidence; what to try.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

_MOST_PROBLEMS = 20
"""Problems of a configuration that are told; the others are counted."""


class ThrowcollectError(Exception):
    """Root of all errors raised on purpose.

    Args:
        message: Where and what: one line.
        expected: What would have been right.
        evidence: What was seen: the tail of a log, a path.
        hint: One command or one edit that gets further.
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
    """What was wrong, what was got and what would be right."""
    key: str = ""
    """Dotted path of the key."""
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
        problems: All problems that were found, at least one; or a single sentence.
        expected: What would have been right.
        hint: One command or one edit that gets further.
        more: Number of problems beside these, which are only counted.
    """

    exit_code = 2

    def __init__(
        self,
        problems: str | Sequence[Problem],
        *,
        expected: str | None = None,
        hint: str | None = None,
        more: int = 0,
    ) -> None:
        self.problems = [Problem(problems)] if isinstance(problems, str) else list(problems)
        lines = list(map(str, self.problems[:_MOST_PROBLEMS]))
        if untold := len(self.problems) - len(lines) + more:
            lines.append(f"and {untold} more")
        super().__init__("\n".join(lines), expected=expected, hint=hint)


class PlanError(ConfigError):
    """The sweep yields no trial that could be run."""


class NotFoundError(ConfigError):
    """What is named does not exist."""


class ConflictError(ConfigError):
    """What is named exists, but in a state that does not allow what is asked for."""


class WorkerError(ThrowcollectError):
    """A process of the run could not be started or was lost for good."""

    exit_code = 3


class LossError(ThrowcollectError):
    """A dataset was collected or mended to its end, but trials of it are lost or doubtful."""

    exit_code = 5


class DatasetError(ThrowcollectError):
    """A dataset is missing, torn or contradicts itself.

    Args:
        problem: What is wrong: one line.
        path: The file or directory in which it is wrong; None if only the caller knows that.
        place: Where in that file, such as ``byte 17``; empty when it is the file as a whole.
        expected: What would have been right.
        evidence: What was seen.
        hint: One command or one edit that gets further.
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
        """What is wrong with all facts but where, for reports that have columns of their own for file and place."""
        return self._with_facts(self.problem)

    def locate(self, path: Path | None = None, place: str = "") -> DatasetError:
        """Return the same error in more detail, for a caller that knows where the bytes came from.

        Args:
            path: The file that they came from; None if that is not known here either.
            place: Where they began; the place of the error itself follows it.
        """
        whole = ": ".join(filter(None, (place, self.place)))
        facts = {"expected": self.expected, "evidence": self.evidence, "hint": self.hint}
        return type(self)(self.problem, path=path or self.path, place=whole, **facts)


class ForeignPlanError(DatasetError):
    """A plan was made for another configuration than the one beside it."""


class OutputError(ThrowcollectError):
    """What was asked for is done, but its result could not be written to standard output."""

    exit_code = 6


class RequestError(ThrowcollectError):
    """What a client asks of a running simulation cannot be done; it is told so and the simulation goes on.

    Args:
        reason: Name of the result code that says why, as the interface definitions spell it: ``NAME_INVALID``.
        message: What was asked for and what is wrong with it: one line.
        expected: What would have been right.
        hint: What gets further.
    """

    def __init__(self, reason: str, message: str, *, expected: str | None = None, hint: str | None = None) -> None:
        self.reason = reason
        super().__init__(message, expected=expected, hint=hint)


class Interrupted(ThrowcollectError):
    """Stopped by the user; what is finished is on disk."""

    exit_code = 130
