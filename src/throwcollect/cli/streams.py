"""Standard streams that nobody can break by closing them, neither before a command starts nor while it runs.

Standard error is a courtesy: what cannot be written there is dropped. What cannot be written to standard output is
dropped as well, so that the command comes to its own end, and is told by an exit code if it matters.
"""

from __future__ import annotations

import errno
import io
import os
import sys
from typing import TYPE_CHECKING, Literal, TextIO

from throwcollect.errors import OutputError

if TYPE_CHECKING:
    from _typeshed import ReadableBuffer

_READER_IS_GONE = (errno.EPIPE, errno.EIO)
"""A pipe that nobody reads any more, and a terminal that was closed."""


class ReaderGone(Exception):
    """Nobody reads standard output any more, for which alone the command goes on."""


class _Stream(io.FileIO):
    """A standard stream; at its first failure it becomes one that takes everything and keeps nothing.

    Attributes:
        kind: What is written: the ``result`` of a command, ``lines`` as long as somebody reads them, or a ``log``.
        failure: Why nothing is written any more; None as long as it is.
    """

    kind: Literal["result", "lines", "log"] = "result"
    failure: OSError | None = None

    def write(self, data: ReadableBuffer, /) -> int:
        if self.failure is None:
            try:
                return super().write(data)
            except OSError as error:
                self.failure = error
                if self.kind == "lines" and self.reader_is_gone:
                    raise ReaderGone from error
        return memoryview(data).nbytes

    @property
    def reader_is_gone(self) -> bool:
        """Whether the failure is that nobody reads any more."""
        return self.failure is not None and self.failure.errno in _READER_IS_GONE


def open_streams() -> None:
    """Have all three standard streams, and have output survive its readers.

    A stream that was closed, as by ``>&-``, becomes ``/dev/null``; otherwise the next file that is opened would get its
    number, and with it whatever is printed.
    """
    for number in (0, 1, 2):
        try:
            os.fstat(number)
        except OSError:
            # It gets the lowest number that is free, which is this one; processes that are started have it, too.
            os.set_inheritable(os.open(os.devnull, os.O_RDWR), True)
    if sys.stdin is None:
        sys.stdin = open(0, closefd=False)  # noqa: SIM115 - it stays open
    sys.stdout = _text(1, sys.stdout)
    sys.stderr = _text(2, sys.stderr)


def end_with_reader() -> None:
    """End this command, quietly, when nobody reads its output any more: it prints lines and does nothing else."""
    _set_kind("lines")


def only_log() -> None:
    """Let output get lost: it is the log of a node, whose work is elsewhere."""
    _set_kind("log")


def ensure_written(*, reader_may_leave: bool = False, hint: str | None = None) -> None:
    """Make sure that all output so far has been written.

    Args:
        reader_may_leave: Whether a reader that has gone has seen enough.
        hint: What to do if it has not.

    Raises:
        OutputError: If it could not be written.
        ReaderGone: If the command should end with its reader, who is gone.
    """
    sys.stdout.flush()
    stream = _standard_output()
    if stream is None or stream.failure is None or stream.kind == "log":
        return
    if not (reader_may_leave and stream.reader_is_gone):
        raise OutputError(f"the output cannot be written: {stream.failure.strerror}", hint=hint)


def _standard_output() -> _Stream | None:
    raw = getattr(getattr(sys.stdout, "buffer", None), "raw", None)
    return raw if isinstance(raw, _Stream) else None


def _set_kind(kind: Literal["lines", "log"]) -> None:
    if (stream := _standard_output()) is not None:
        stream.kind = kind


def _text(number: int, as_started: TextIO | None) -> TextIO:
    """Text to a descriptor, encoded as Python has chosen, and without delay if it has chosen so."""
    chosen = as_started if isinstance(as_started, io.TextIOWrapper) else None
    prompt = (
        number == 2 or os.isatty(number) or (chosen is not None and (chosen.line_buffering or chosen.write_through))
    )
    return io.TextIOWrapper(
        io.BufferedWriter(_Stream(number, "w", closefd=False)),
        encoding=chosen.encoding if chosen else "utf-8",
        # A name of a file may hold bytes that are no text.
        errors="backslashreplace",
        line_buffering=prompt,
    )
