"""Standard streams that survive being closed, before a command starts or while it runs.

Output that cannot be written is dropped, so that the command still does its work and ends properly. Lost standard
output is reported by the exit code where it matters; lost standard error never is.
"""

from __future__ import annotations

import errno
import io
import os
import select
import sys
from typing import TYPE_CHECKING, Literal, TextIO

from throwcollect.errors import OutputError

if TYPE_CHECKING:
    from _typeshed import ReadableBuffer

_READER_IS_GONE = (errno.EPIPE, errno.EIO)
"""Errors of a pipe whose reader has ended, and of a terminal that was closed."""

_ERRORS = "backslashreplace"
"""What is done about characters that cannot be encoded: the name of a file may hold bytes that are no text."""


class ReaderGone(Exception):
    """The reader of standard output has ended, and the command has nothing else to do than to print."""


class _Stream(io.FileIO):
    """A standard stream that drops all output after its first failure.

    Attributes:
        kind: Kind of output: the ``result`` of a command, ``lines`` that matter only to a reader, or a ``log``.
        failure: The error after which output is dropped; None while output is written.
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
        # Tell the buffer that all was written; it would otherwise keep the rest, and try again at the end.
        return memoryview(data).nbytes

    @property
    def reader_is_gone(self) -> bool:
        """Whether output is dropped because its reader has ended."""
        return self.failure is not None and self.failure.errno in _READER_IS_GONE


def open_streams() -> None:
    """Make sure that all three standard streams exist, and that a command goes on when a reader of its output ends.

    A stream that was closed, as by ``>&-``, becomes ``/dev/null``. Otherwise the next file that is opened would get its
    descriptor, and the output would be written into that file.
    """
    for number in (0, 1, 2):
        try:
            os.fstat(number)
        except OSError:
            # open() takes the lowest free descriptor, which is this one. Child processes must inherit it, too.
            os.set_inheritable(os.open(os.devnull, os.O_RDWR), True)
    if sys.stdin is None:
        sys.stdin = open(0, closefd=False)  # noqa: SIM115 - it stays open
    sys.stdout = _open_text(1, sys.stdout)
    sys.stderr = _open_text(2, sys.stderr)


def end_with_reader() -> None:
    """Make this command end without a message when its reader does, because it does nothing but print lines."""
    _set_kind("lines")


def has_reader() -> bool:
    """Find out whether anybody may still read standard output, without writing to it.

    A command that waits for something to print asks this meanwhile; otherwise, it would notice only when it prints the
    next line that its reader has ended.
    """
    poll = select.poll()
    poll.register(1, 0)
    # A pipe without a reader is reported as POLLERR, whatever events were asked for (poll(2)).
    return not any(happened & select.POLLERR for _, happened in poll.poll(0))


def only_log() -> None:
    """Prepare for output that is only the log of a node: it is UTF-8, as the launcher reads it, and may be lost."""
    _set_kind("log")
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(encoding="utf-8", errors=_ERRORS)


def ensure_written(*, reader_may_leave: bool = False, hint: str | None = None) -> None:
    """Check that all output so far has been written.

    Args:
        reader_may_leave: Whether output may be lost because its reader has ended, as `head` does.
        hint: How the user gets the output that was lost.
    """
    sys.stdout.flush()
    stream = _find_standard_output()
    if stream is None or stream.failure is None or stream.kind == "log":
        return
    if not (reader_may_leave and stream.reader_is_gone):
        raise OutputError(f"the output cannot be written: {stream.failure.strerror}", hint=hint)


def _find_standard_output() -> _Stream | None:
    raw = getattr(getattr(sys.stdout, "buffer", None), "raw", None)
    return raw if isinstance(raw, _Stream) else None


def _set_kind(kind: Literal["lines", "log"]) -> None:
    if (stream := _find_standard_output()) is not None:
        stream.kind = kind


def _open_text(number: int, as_started: TextIO | None) -> TextIO:
    """Open a descriptor for text, with the encoding and the buffering that Python has chosen for it."""
    # Standard error and a terminal get each line at once, and so does everything with `python -u` (write_through).
    chosen = as_started if isinstance(as_started, io.TextIOWrapper) else None
    prompt = (
        number == 2 or os.isatty(number) or (chosen is not None and (chosen.line_buffering or chosen.write_through))
    )
    return io.TextIOWrapper(
        io.BufferedWriter(_Stream(number, "w", closefd=False)),
        encoding=chosen.encoding if chosen else "utf-8",
        errors=_ERRORS,
        line_buffering=prompt,
    )
