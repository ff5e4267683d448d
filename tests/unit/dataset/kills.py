"""Simulated kills: files are copied as a kill would leave them."""

from __future__ import annotations

import os
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest


class KilledEverywhere:
    """Within this block a directory is copied in each call that changes a file, as a kill in that call would leave it.

    The copy in a write has half of its bytes. A kill leaves nothing of files without a name.

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
        for name in ("write", "replace", "unlink", "ftruncate", "fsync"):
            self._patch.setattr(os, name, self._copy_before(name, getattr(os, name)))
        return self

    def __exit__(self, *_: object) -> None:
        self._patch.undo()

    def copy(self) -> None:
        if not self._directory.exists():
            return
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
