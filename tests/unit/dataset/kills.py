"""Simulated kills: a process dies while it changes files, or the files are copied as a kill would leave them."""

from __future__ import annotations

import os
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest


class Killed(BaseException):
    """Raised where the process would die; every later call that changes a file raises it again."""


class KilledAt:
    """Within this block the process dies in the n-th call that changes a file; a write then leaves half its bytes.

    Writes to files without a name do not count: a kill leaves nothing of such files.

    Attributes:
        died: Whether that call was reached.
    """

    NAMES = ("write", "replace", "unlink", "ftruncate", "fsync")

    def __init__(self, call: int) -> None:
        self._left = call
        self.died = False

    def __enter__(self) -> KilledAt:
        self._originals = {name: getattr(os, name) for name in self.NAMES}
        for name, original in self._originals.items():
            setattr(os, name, self._count(name, original))
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: object) -> bool:
        for name, original in self._originals.items():
            setattr(os, name, original)
        return kind is Killed

    def _count(self, name: str, original: Callable[..., Any]) -> Callable[..., Any]:
        def call(*arguments: Any, **options: Any) -> Any:
            if self.died:
                raise Killed
            if name == "write" and not os.fstat(arguments[0]).st_nlink:
                return original(*arguments, **options)
            self._left -= 1
            if self._left < 0:
                self.died = True
                if name == "write":
                    original(arguments[0], arguments[1][: len(arguments[1]) // 2])
                raise Killed
            return original(*arguments, **options)

        return call


class KilledEverywhere:
    """Within this block a directory is copied in each call that changes a file, as a kill in that call would leave it.

    The copy in a write has half of its bytes.

    Attributes:
        left: Each copy, and the trials whose episodes had been appended by then.
        appended: The trials whose episodes have been appended so far.
    """

    def __init__(self, directory: Path, copies: Path) -> None:
        self.left: list[tuple[Path, frozenset[int]]] = []
        self.appended: set[int] = set()
        self._directory, self._copies = directory, copies

    def __enter__(self) -> KilledEverywhere:
        self._patch = pytest.MonkeyPatch()
        for name in KilledAt.NAMES:
            self._patch.setattr(os, name, self._copy_before(name, getattr(os, name)))
        return self

    def __exit__(self, *_: object) -> None:
        self._patch.undo()

    def copy(self) -> None:
        path = self._copies / str(len(self.left))
        self.left.append((Path(shutil.copytree(self._directory, path)), frozenset(self.appended)))

    def _copy_before(self, name: str, original: Callable[..., Any]) -> Callable[..., Any]:
        def call(*arguments: Any, **options: Any) -> Any:
            if name != "write":
                self.copy()
                return original(*arguments, **options)
            file, data = arguments
            if not os.fstat(file).st_nlink:
                return original(file, data)
            half = original(file, data[: len(data) // 2])
            self.copy()
            return half + original(file, data[half:])

        return call
