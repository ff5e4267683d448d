"""Guards C libraries that read descriptions: from the locale of the process, and by what they print.

With a decimal comma, which Qt sets for German users, C reads ``0.5`` as 0. And where a library cannot use what it was
given, it often prints so, and goes on with less.
"""

from __future__ import annotations

import ctypes
import locale
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
_LIBC = ctypes.CDLL(None)
_LIBC.newlocale.argtypes = (ctypes.c_int, ctypes.c_char_p, ctypes.c_void_p)
_LIBC.uselocale.argtypes = (ctypes.c_void_p,)
_LIBC.newlocale.restype = _LIBC.uselocale.restype = ctypes.c_void_p
_C_LOCALE = _LIBC.newlocale(1 << locale.LC_NUMERIC, b"C", None)
_lock = Lock()
"""The descriptors belong to the whole process, so only one thread at a time may redirect them."""


@contextmanager
def reading_natively(what: str) -> Iterator[None]:
    """Let C code that this thread calls read numbers with a decimal point, and raise an error if it complains.

    Other threads keep the locale of the process, those that the C code itself starts among them. What is printed
    meanwhile on standard output and standard error, and is no complaint, is printed afterwards.

    Args:
        what: What the library reads, such as the path of a file.
    """
    flush = _LIBC.fflush
    with _lock, tempfile.TemporaryFile() as printed:
        sys.stdout.flush()
        sys.stderr.flush()
        flush(None)
        kept = [os.dup(stream) for stream in _STREAMS]
        for stream in _STREAMS:
            os.dup2(printed.fileno(), stream)
        before = _LIBC.uselocale(_C_LOCALE)
        try:
            yield
        except ConfigError as error:
            flush(None)
            error.evidence = error.evidence or _in_one_line(_read(printed)) or None
            raise
        finally:
            _LIBC.uselocale(before)
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
