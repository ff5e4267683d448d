"""The sources from which an image is made, which are a clone of the project, and the labels that name them later."""

from __future__ import annotations

import hashlib
import re
import subprocess
import tarfile
from pathlib import Path
from typing import IO
from urllib.parse import urlsplit

from throwcollect.errors import ConfigError

DEFAULT_BASE = "python:3.11-slim-bookworm"
"""Base image, as in the Dockerfile."""
DOCKERFILE = "docker/Dockerfile"
SOURCES_LABEL = "throwcollect.sources"
"""Label with the digest of the sources in an image."""
VERSION_LABEL = "org.opencontainers.image.version"
"""Label with the version of the sources in an image."""
UNKNOWN = "unknown"
"""Content of a label that has no value."""

_PACKAGE = Path(__file__).parents[1]
"""Directory of this package."""
_SOURCES = ("pyproject.toml", "configs/quickstart.yaml", "src")
_INTERFACES = ("packaging/ros_interfaces", "packaging/ros_constraints.txt")
"""Further sources of the wheel with interfaces of ROS 2."""
_LEFT_OUT = re.compile(r"__pycache__|.*\.egg-info")
_SCHEMES = ("https", "http", "ssh", "git")
_SSH_ADDRESS = re.compile(r"(?:[^@:/]+@)?([^@:/]{2,}):(?!//)/?(.+)")
"""An address in the short form of ssh: ``git@host:path``."""


def source_root() -> Path:
    """Find the directory of the clone from which this package runs."""
    root = _PACKAGE.parents[1]
    if not all((root / name).exists() for name in (DOCKERFILE, *_SOURCES)):
        raise ConfigError(
            f"{_PACKAGE}: is not in a clone of the project, so there is nothing to build an image from",
            hint="clone it and run: pip install -e .; or name an image that exists",
        )
    return root


def digest_sources(root: Path) -> str:
    """SHA-256 over all files of a clone that are installed, in hexadecimal."""
    digest = hashlib.sha256()
    for path in [root / "pyproject.toml", *sorted((root / "src").rglob("*"))]:
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
    try:
        root = source_root()
    except ConfigError:
        return False
    return sources not in (None, UNKNOWN, digest_sources(root))


def check_wheelhouse(wheelhouse: Path | None) -> None:
    """Make sure that a directory holds wheels; None takes them from the package index."""
    if wheelhouse is not None and not any(wheelhouse.glob("*.whl")):
        raise ConfigError(f"{wheelhouse}: holds no wheels", hint="docker/wheelhouse.py --ros fills it")


def write_context(archive: IO[bytes], root: Path, wheelhouse: Path | None) -> None:
    """Write the files from which an image is built as a tar archive; wheels go into `docker/wheelhouse`."""

    def entry(info: tarfile.TarInfo) -> tarfile.TarInfo | None:
        info.uid = info.gid = 0
        info.uname = info.gname = ""
        # Any user may run the image, and has to be able to read the files, whatever the umask of the clone was.
        info.mode = 0o755 if info.mode & 0o100 else 0o644
        return None if _LEFT_OUT.fullmatch(Path(info.name).name) else info

    with tarfile.open(fileobj=archive, mode="w") as context:
        for name in (*_SOURCES, *_INTERFACES):
            context.add(root / name, name, filter=entry)
        for path in sorted((root / "docker").iterdir()):
            if path.is_file():
                context.add(path, f"docker/{path.name}", filter=entry)
        for wheel in sorted(wheelhouse.glob("*.whl")) if wheelhouse is not None else ():
            context.add(wheel, f"docker/wheelhouse/{wheel.name}", filter=entry)


def find_revision(root: Path) -> str | None:
    """Commit of a clone, with ``-dirty`` if files differ from it; None if git does not tell."""
    if not (revision := _git(root, "rev-parse", "HEAD")):
        return None
    return revision + ("-dirty" if _git(root, "status", "--porcelain", "--", "docker", *_SOURCES) else "")


def find_address(root: Path) -> str | None:
    """Address at which others find the sources, without the user name and the password that git may have in it."""
    origin = _git(root, "remote", "get-url", "origin") or ""
    if short := _SSH_ADDRESS.fullmatch(origin):
        return f"ssh://{short[1]}/{short[2]}"
    parts = urlsplit(origin)
    if parts.scheme not in _SCHEMES or not parts.hostname:
        return None
    return parts._replace(netloc=parts.netloc.rpartition("@")[2], query="", fragment="").geturl()


def _git(root: Path, *arguments: str) -> str | None:
    """Run git in a clone, and return its output; None if it fails, or the directory is only a part of a clone."""
    if not (root / ".git").exists():
        return None
    try:
        answer = subprocess.run(["git", "-C", root, *arguments], capture_output=True, text=True, check=True)
    except (OSError, subprocess.CalledProcessError):
        return None
    return answer.stdout.strip()
