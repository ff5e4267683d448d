"""Standard streams that survive the end of their readers.

Output that cannot be written is dropped, so that a command still does its work and ends properly. The exit code reports
lost standard output where it matters.
"""

from __future__ import annotations

import errno
import io
import os
import select
import sys
from typing import TYPE_CHECKING, TextIO

from throwcollect.errors import OutputError

if TYPE_CHECKING:
    from _typeshed import ReadableBuffer

_READER_IS_GONE = (errno.EPIPE, errno.EIO)
"""Errors of a pipe whose reader has ended, and of a terminal that was closed."""


class _Stream(io.FileIO):
    """A standard stream that drops all output after its first failure.

    Attributes:
        failure: The error after which output is dropped; None while output is written.
    """

    failure: OSError | None = None

    def write(self, data: ReadableBuffer, /) -> int:
        if self.failure is None:
            try:
                return super().write(data)
            except OSError as error:
                self.failure = error
        # Report to the buffer that all was written; it would otherwise keep the rest, and try again at the end.
        return memoryview(data).nbytes


def open_streams() -> None:
    """Let a command go on when a reader of its output, or of its remarks, ends."""
    sys.stdout, sys.stderr = _open_text(1, sys.stdout), _open_text(2, sys.stderr)


def has_reader() -> bool:
    """Find out whether standard output may still have a reader, without writing to it; commands that wait ask this."""
    poll = select.poll()
    poll.register(1, 0)
    # A pipe without a reader is reported as POLLERR, whatever events were asked for (poll(2)).
    return not any(happened & select.POLLERR for _, happened in poll.poll(0))


def ensure_written(*, reader_may_leave: bool = False, hint: str | None = None) -> None:
    """Check that all output so far has been written.

    Args:
        reader_may_leave: Whether output may be lost because its reader has ended, as `head` does.
        hint: How the user gets the output that was lost.
    """
    sys.stdout.flush()
    failure = getattr(getattr(getattr(sys.stdout, "buffer", None), "raw", None), "failure", None)
    if failure is not None and not (reader_may_leave and failure.errno in _READER_IS_GONE):
        raise OutputError(f"the output cannot be written: {failure.strerror}", hint=hint)


def _open_text(number: int, as_started: TextIO) -> TextIO:
    """Open a descriptor for text, with the encoding that Python has chosen for it."""
    return io.TextIOWrapper(
        io.BufferedWriter(_Stream(number, "w", closefd=False)),
        encoding=as_started.encoding,
        errors="backslashreplace",
        line_buffering=number == 2 or os.isatty(number),
    )
