"""The labels that name the sources of an image, and whether they are those of the clone that this package runs from."""

from __future__ import annotations

import hashlib
import re
from pathlib import Path

SOURCES_LABEL = "throwcollect.sources"
"""Label with the digest of the sources in an image."""
VERSION_LABEL = "org.opencontainers.image.version"
"""Label with the version of the sources in an image."""
UNKNOWN = "unknown"
"""Content of a label that has no value."""

_CLONE = Path(__file__).parents[4]
"""Directory of the clone from which this package runs, if it is in one."""
_LEFT_OUT = re.compile(r"__pycache__|.*\.egg-info")


def digest_sources(root: Path = _CLONE) -> str:
    """SHA-256 over all files of a clone that decide what is installed, in hexadecimal."""
    digest = hashlib.sha256()
    for path in [root / "pyproject.toml", root / "uv.lock", *sorted((root / "src").rglob("*"))]:
        inside = path.relative_to(root)
        if path.is_file() and not any(map(_LEFT_OUT.fullmatch, inside.parts)):
            content = path.read_bytes()
            # Without the zero byte and the length, different lists of files could give the same sequence of bytes.
            digest.update(f"{inside.as_posix()}\0{len(content)}\0".encode() + content)
    return digest.hexdigest()


def are_others(sources: str | None) -> bool:
    """Whether an image with this label was made from other sources than those of this package's clone.

    Without a label or a clone, this cannot be found out, and the answer is no.
    """
    if sources in (None, UNKNOWN) or not (_CLONE / "docker" / "Dockerfile").exists():
        return False
    return sources != digest_sources(_CLONE)
