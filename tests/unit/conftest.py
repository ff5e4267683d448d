"""A locale with a decimal comma."""

import locale
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path

import pytest

# This is LC_NUMERIC of de_DE.UTF-8 as glibc's `localedef` writes it; few machines have that locale.
_DECIMAL_COMMA = bytes.fromhex(
    "1411032006000000200000002200000024000000280000002c000000300000002c002e00030300002c0000002e0000005554462d3800"
)


@pytest.fixture
def use_decimal_comma(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Callable[[], str]]:
    """Gives the process a locale with a decimal comma, as Qt would, until the end of the test."""
    (tmp_path / "comma").mkdir()
    (tmp_path / "comma" / "LC_NUMERIC").write_bytes(_DECIMAL_COMMA)
    monkeypatch.setenv("LOCPATH", str(tmp_path))
    before = locale.setlocale(locale.LC_NUMERIC)
    yield partial(locale.setlocale, locale.LC_NUMERIC, "comma")
    locale.setlocale(locale.LC_NUMERIC, before)
