"""A directory that appears whole or not at all."""

from __future__ import annotations

import os
import shutil
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from throwcollect.errors import ConfigError
from throwcollect.files import unwritable

_PERMISSIONS = 0o755


@contextmanager
def new_directory(path: Path) -> Iterator[Path]:
    """A directory that gets its name when the block ends well, and vanishes when it does not.

    Args:
        path: The directory; must not exist, or be empty.

    Yields:
        Where to write meanwhile: a hidden directory beside it.

    Raises:
        ConfigError: If there is already something.
        DatasetError: If the directory cannot be written.
    """
    try:
        if path.is_symlink() or (path.exists() and not (path.is_dir() and not any(path.iterdir()))):
            raise ConfigError(f"{path}: exists", expected="a directory that is new or empty")
        if not path.parent.exists():
            path.parent.mkdir(parents=True)
        beside = Path(tempfile.mkdtemp(prefix=f".{path.name}.", dir=path.parent))
    except OSError as error:
        raise unwritable(path, error) from error
    try:
        yield beside
        beside.chmod(_PERMISSIONS)
        os.rename(beside, path)
    except OSError as error:
        raise unwritable(path, error) from error
    finally:
        shutil.rmtree(beside, ignore_errors=True)
