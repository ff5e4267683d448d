"""Turns what C libraries print into errors: they print where they go on with less than they were given."""

from __future__ import annotations

import ctypes
import os
import re
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from threading import Lock
from typing import IO

from throwcollect.errors import ConfigError

_COMPLAINT = re.compile(r"^(b3Warning|b3Error|Error:|Warning:|QH\d+)", re.MULTILINE)
"""How complaints of Bullet, of urdfdom and of qhull begin."""

_LONGEST = 500
_STREAMS = (1, 2)
_lock = Lock()
"""The descriptors belong to the whole process, so only one thread at a time may redirect them."""


@contextmanager
def failing_on_output(what: str) -> Iterator[None]:
    """Raise an error if a library complains on standard output or standard error; anything else is printed afterwards.

    Args:
        what: What the library reads, such as the path of a file.

    Raises:
        ConfigError: If it complains.
    """
    flush = ctypes.CDLL(None).fflush
    with _lock, tempfile.TemporaryFile() as printed:
        sys.stdout.flush()
        sys.stderr.flush()
        flush(None)
        kept = [os.dup(stream) for stream in _STREAMS]
        for stream in _STREAMS:
            os.dup2(printed.fileno(), stream)
        try:
            yield
        except ConfigError as error:
            flush(None)
            error.evidence = error.evidence or _in_one_line(_read(printed)) or None
            raise
        finally:
            # The libraries of C keep what they print in a buffer of their own.
            flush(None)
            for stream, original in zip(_STREAMS, kept, strict=True):
                os.dup2(original, stream)
                os.close(original)
        text = _read(printed)
    if _COMPLAINT.search(text):
        raise ConfigError(f"{what}: {_in_one_line(text)}")
    if text:
        print(text, end="", file=sys.stderr)


def _read(printed: IO[bytes]) -> str:
    printed.seek(0)
    return printed.read().decode(errors="replace")


def _in_one_line(text: str) -> str:
    return " ".join(text.split())[:_LONGEST]
