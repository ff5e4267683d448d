"""Guards C libraries that read descriptions from the locale of the process.

With a decimal comma, which Qt sets for German users, C reads ``0.5`` as 0.
"""

from __future__ import annotations

import ctypes
import locale
from collections.abc import Iterator
from contextlib import contextmanager

_LIBC = ctypes.CDLL(None)
_LIBC.newlocale.argtypes = (ctypes.c_int, ctypes.c_char_p, ctypes.c_void_p)
_LIBC.uselocale.argtypes = (ctypes.c_void_p,)
_LIBC.newlocale.restype = _LIBC.uselocale.restype = ctypes.c_void_p
_C_LOCALE = _LIBC.newlocale(1 << locale.LC_NUMERIC, b"C", None)


@contextmanager
def reading_natively() -> Iterator[None]:
    """Let C code that this thread calls read numbers with a decimal point; other threads keep their locale."""
    before = _LIBC.uselocale(_C_LOCALE)
    try:
        yield
    finally:
        _LIBC.uselocale(before)
