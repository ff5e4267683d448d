"""The image that containers are made from: built from a clone of the project, or pulled."""

from __future__ import annotations

import hashlib
import re
import shlex
import subprocess
import tarfile
import tempfile
from collections import deque
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import IO
from urllib.parse import urlsplit

from docker.client import DockerClient
from docker.errors import ImageNotFound

from throwcollect.errors import ConfigError, WorkerError
from throwcollect.runtimes.docker.engine import engine_errors
from throwcollect.version import __version__

DEFAULT_BASE = "python:3.11-slim-bookworm"
"""Base image, as in the Dockerfile."""

_PACKAGE = Path(__file__).parents[2]
"""This package, as it is installed."""
_DOCKERFILE = "docker/Dockerfile"
_TARGET = "throwcollect"
_SOURCES = ("pyproject.toml", "README.md", "configs/quickstart.yaml", "src")
_INTERFACES = ("packaging/ros_interfaces", "packaging/ros_constraints.txt")
"""What the wheel with interfaces of ROS 2 is made from, besides sources."""
_LEFT_OUT = re.compile(r"__pycache__|.*\.egg-info")
SOURCES_LABEL = "throwcollect.sources"
"""Label that tells which sources are installed in an image."""
SOURCE_LABEL = "org.opencontainers.image.source"
"""Label that tells where the sources come from; an image of a clone from nowhere else than this machine has none."""
RMW_LABEL = "throwcollect.rmw"
"""Label that tells which middleware genuine rclpy has in an image; an image without rclpy has none."""
_SCHEMES = ("https", "http", "ssh", "git")
_SSH_ADDRESS = re.compile(r"(?:[^@:/]+@)?([^@:/]{2,}):(?!//)/?(.+)")
"""The short form of ssh: ``git@host:path``."""
_EVIDENCE_LINES = 15
_STEP = re.compile(r"Step (\d+/\d+) : (.*)")
_STEP_COLUMNS = 100
_COLOURS = re.compile(r"\x1b\[[0-9;]*m")
_BOOKKEEPING = re.compile(r" ---> |Removing intermediate container ")
_MISSING_WHEEL = re.compile(r"No matching distribution found for (.*)")
_UNKNOWN = "unknown"


def default_tag() -> str:
    """Tag of the image that belongs to this version."""
    return f"throwcollect:{__version__}"


def build(
    client: DockerClient,
    tag: str,
    *,
    base: str = DEFAULT_BASE,
    wheelhouse: Path | None = None,
    say: Callable[[str], None],
) -> int:
    """Build the image from the clone that this package runs from.

    Args:
        client: Client of the engine.
        tag: Name of the image.
        base: Base image, which is pulled if the engine does not have it.
        wheelhouse: Directory of wheels, as `docker/wheelhouse.py` fills it; None takes them from the package index.
        say: Called with one line for each step.

    Returns:
        Size of the image [B].

    Raises:
        ConfigError: If the package does not run from a clone, or the wheelhouse holds no wheels.
        WorkerError: If the engine does not answer, the base image cannot be had, or a step fails.
    """
    root = source_root()
    if wheelhouse is not None and not any(wheelhouse.glob("*.whl")):
        raise ConfigError(
            f"{wheelhouse}: holds no wheels",
            hint=shlex.join(["python", f"{root}/docker/wheelhouse.py", str(wheelhouse)]),
        )
    if not _is_there(client, base):
        hint = "throwcollect image build --base IMAGE takes another one; docker/base.sh makes one from Debian packages"
        say(f"pulling {base}")
        with engine_errors(f"the base image {base} is not here and cannot be pulled", hint=hint):
            client.images.pull(base)
    revision, address = _revision(root), _address(root)
    arguments = {
        "BASE_IMAGE": base,
        "VERSION": __version__,
        "REVISION": revision or _UNKNOWN,
        "SOURCES": _digest_of(root),
    }
    labels = {SOURCE_LABEL: address} if address else {}
    with engine_errors(f"{tag}: cannot be built"), tempfile.TemporaryFile() as context:
        _write_context(context, root, wheelhouse)
        context.seek(0)
        _run_steps(client, context, tag, arguments, labels, wheelhouse, say)
        return int(client.images.get(tag).attrs["Size"])


def ensure(client: DockerClient, tag: str, *, say: Callable[[str], None]) -> None:
    """Make sure that the engine has an image: the default one is built from a clone, any other is pulled.

    Args:
        client: Client of the engine.
        tag: Name of the image.
        say: Called with one line before anything that takes long.

    Raises:
        WorkerError: If the image is missing and cannot be had.
    """
    if _is_there(client, tag):
        return
    if tag != default_tag():
        say(f"image {tag} is not here; pulling it")
        with engine_errors(
            f"the image {tag} is not here and cannot be pulled", hint="docker load brings one from a file"
        ):
            client.images.pull(tag)
        return
    try:
        root = source_root()
        say(f"image {tag} is not here; building it from {root}, once, which takes minutes")
        build(client, tag, say=lambda _line: None)
    except ConfigError as error:
        raise WorkerError(
            f"the image {tag} is not here and cannot be built: {error.message}", hint=error.hint
        ) from error


def is_outdated(client: DockerClient, tag: str) -> bool:
    """Whether the label of an image says that it was made from other sources than those of the clone.

    Args:
        client: Client of the engine.
        tag: Name of the image, which the engine has.

    Raises:
        WorkerError: If the engine does not answer.
    """
    try:
        root = source_root()
    except ConfigError:
        return False
    with engine_errors(f"the engine does not say what the image {tag} holds"):
        label = client.images.get(tag).labels.get(SOURCES_LABEL, _UNKNOWN)
    return label not in (_UNKNOWN, _digest_of(root))


def rmw_of(client: DockerClient, tag: str) -> str | None:
    """Middleware of the genuine rclpy in an image; None if it has no rclpy.

    Args:
        client: Client of the engine.
        tag: Name of the image, which the engine has.

    Raises:
        WorkerError: If the engine does not answer.
    """
    with engine_errors(f"the engine does not say what the image {tag} holds"):
        label = client.images.get(tag).labels.get(RMW_LABEL)
    return label if isinstance(label, str) else None


def source_root() -> Path:
    """Directory of the clone that this package runs from.

    Raises:
        ConfigError: If it was installed in another way than from a clone, in editable mode.
    """
    root = _PACKAGE.parents[1]
    if not all((root / name).exists() for name in (_DOCKERFILE, *_SOURCES)):
        raise ConfigError(
            f"{_PACKAGE}: is not in a clone of the project, so there is nothing to build an image from",
            hint="clone it and run: pip install -e .; or name an image that exists",
        )
    return root


def _is_there(client: DockerClient, image: str) -> bool:
    with engine_errors(f"the engine does not say whether it has the image {image}"):
        try:
            client.images.get(image)
        except ImageNotFound:
            return False
        return True


def _digest_of(root: Path) -> str:
    """SHA-256 over all that is installed of a clone, in hexadecimal."""
    digest = hashlib.sha256()
    for path in [root / "pyproject.toml", *sorted((root / "src").rglob("*"))]:
        inside = path.relative_to(root)
        if path.is_file() and not any(map(_LEFT_OUT.fullmatch, inside.parts)):
            content = path.read_bytes()
            digest.update(f"{inside.as_posix()}\0{len(content)}\0".encode() + content)
    return digest.hexdigest()


def _write_context(archive: IO[bytes], root: Path, wheelhouse: Path | None) -> None:
    """Write what the Dockerfile copies, and nothing else, as a tar archive."""

    def entry(info: tarfile.TarInfo) -> tarfile.TarInfo | None:
        info.uid = info.gid = 0
        info.uname = info.gname = ""
        return None if _LEFT_OUT.fullmatch(Path(info.name).name) else info

    with tarfile.open(fileobj=archive, mode="w") as context:
        for name in (*_SOURCES, *_INTERFACES):
            context.add(root / name, name, filter=entry)
        for path in sorted((root / "docker").iterdir()):
            if path.is_file():
                context.add(path, f"docker/{path.name}", filter=entry)
        for wheel in sorted(wheelhouse.glob("*.whl")) if wheelhouse is not None else ():
            context.add(wheel, f"docker/wheelhouse/{wheel.name}", filter=entry)


def _run_steps(
    client: DockerClient,
    context: IO[bytes],
    tag: str,
    arguments: Mapping[str, str],
    labels: Mapping[str, str],
    wheelhouse: Path | None,
    say: Callable[[str], None],
) -> None:
    printed: deque[str] = deque(maxlen=_EVIDENCE_LINES)
    missing: str | None = None
    answers = client.api.build(
        fileobj=context,
        custom_context=True,
        dockerfile=_DOCKERFILE,
        target=_TARGET,
        tag=tag,
        buildargs=arguments,
        labels=labels,
        rm=True,
        forcerm=True,
        decode=True,
    )
    for answer in answers:
        for line in _COLOURS.sub("", answer.get("stream", "")).splitlines():
            if step := _STEP.fullmatch(line.strip()):
                say(f"step {step[1]}: {' '.join(step[2].split()):.{_STEP_COLUMNS}}")
            elif line.strip() and not _BOOKKEEPING.match(line):
                printed.append(line.rstrip())
            if found := _MISSING_WHEEL.search(line):
                missing = found[1]
        if "error" in answer:
            raise _failure(tag, answer["error"].strip(), missing, wheelhouse, "\n".join(printed))


def _failure(tag: str, error: str, missing: str | None, wheelhouse: Path | None, log: str) -> WorkerError:
    if missing is None:
        return WorkerError(f"{tag}: cannot be built: {error}", evidence=log)
    if wheelhouse is None:
        hint = "throwcollect image build --wheelhouse DIR takes wheels from there; docker/wheelhouse.py fills one"
        return WorkerError(f"{tag}: cannot be built: the package index gives no {missing}", evidence=log, hint=hint)
    hint = shlex.join(["python", "docker/wheelhouse.py", str(wheelhouse)])
    return WorkerError(f"{tag}: cannot be built: {wheelhouse} lacks {missing}", evidence=log, hint=hint)


def _revision(root: Path) -> str | None:
    """Commit of a clone; None if it is not one."""
    if not (root / ".git").exists() or not (revision := _git(root, "rev-parse", "HEAD")):
        return None
    return revision + ("-dirty" if _git(root, "status", "--porcelain", "--", "docker", *_SOURCES) else "")


def _address(root: Path) -> str | None:
    """Where others find the sources, without the name and the password that the address of a clone may hold."""
    origin = (_git(root, "remote", "get-url", "origin") if (root / ".git").exists() else None) or ""
    if short := _SSH_ADDRESS.fullmatch(origin):
        return f"ssh://{short[1]}/{short[2]}"
    parts = urlsplit(origin)
    if parts.scheme not in _SCHEMES or not parts.hostname:
        return None
    return parts._replace(netloc=parts.netloc.rpartition("@")[2], query="", fragment="").geturl()


def _git(root: Path, *arguments: str) -> str | None:
    """What git prints; None where it cannot say."""
    try:
        answer = subprocess.run(["git", "-C", root, *arguments], capture_output=True, text=True, check=True)
    except (OSError, subprocess.CalledProcessError):
        return None
    return answer.stdout.strip()
