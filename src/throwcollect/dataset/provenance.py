"""How a dataset was collected: ``provenance.json``.

Where, when and how fast a collection ran does not follow from its configuration, so neither digest nor manifest cover
this file. It and the data card, which shows it to people, may differ between two collections of one configuration. The
file has the SHA-256 of the data card and of its own other lines, so that changed bytes of both are found.
"""

from __future__ import annotations

import hashlib
import json
import os
import platform
import socket
import subprocess
from collections.abc import Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass
from datetime import datetime, timezone
from functools import cache
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

from pydantic import TypeAdapter

from throwcollect.dataset.directory import CARD, PROVENANCE
from throwcollect.dataset.manifest import Finding, entry_of_file
from throwcollect.errors import DatasetError, ThrowcollectError
from throwcollect.files import read_text, write_file
from throwcollect.members import load_member
from throwcollect.version import __version__

HOST_VARIABLE = "THROWCOLLECT_HOST"
"""Environment variable with the name of the machine, for containers, which cannot know it; empty if it is unknown."""
IMAGE_VARIABLE = "THROWCOLLECT_IMAGE"
"""Environment variable with the id of a container's image, which it cannot know either."""

_LIBRARIES = [
    "pybullet",
    "mujoco-core",
    "numpy",
    "mcap",
    "zstandard",
    "pyarrow",
    "pin",
    "example-robot-data",
]
_MOST_BYTES = 1_000_000
_OWN_HASH = "sha256"
_CARD_HASH = "card_sha256"
_OPEN = "any process that reached the router could join, read and disturb the collection"


@dataclass(frozen=True)
class Provenance:
    """How one collection was run.

    Attributes:
        finished: When it ended.
        host: Name of the machine that wrote the dataset; None if it is not known, as in a container.
        platform: Its system and processor.
        python: Version of Python.
        libraries: Versions of the libraries that the data pass through.
        simulations: Number of simulations of the run that finished it; None if it had none, or if not known.
        wall_s: Real time that it took [s]; None if not known.
        was_open: Whether any process that reached its router could join it.
        revision: Git revision of the sources that ran, with ``-dirty`` behind it if they were changed; None if they lie
            in no clone.
        image: Id of the image that ran; None without one.
        robot_sha256: SHA-256 of the robot's description; None if not known.
        steps: How its engine took steps where this was written, if there are several ways; all give the same bits.
        session: Simulation whose clients were recorded; None if the trials were collected.
    """

    finished: datetime
    host: str | None
    platform: str
    python: str
    libraries: Mapping[str, str]
    simulations: int | None
    wall_s: float | None
    was_open: bool
    revision: str | None = None
    image: str | None = None
    robot_sha256: str | None = None
    steps: str | None = None
    session: str | None = None

    @classmethod
    def of_this_machine(
        cls, *, simulations: int | None, wall_s: float | None, was_open: bool, robot: str, engine: str | None = None
    ) -> Provenance:
        """Make the provenance of a collection by an engine that ends now, here; `robot` is the robot's description."""
        return cls(
            finished=datetime.now(timezone.utc),
            # Inside a container, the host name is only a random id.
            host=os.environ.get(HOST_VARIABLE, socket.gethostname()) or None,
            platform=platform.platform(),
            python=platform.python_version(),
            libraries=find_versions(),
            simulations=simulations,
            wall_s=wall_s,
            was_open=was_open,
            revision=_read_revision(),
            image=os.environ.get(IMAGE_VARIABLE) or None,
            steps=_describe_steps(engine) if engine else None,
            robot_sha256=hashlib.sha256(robot.encode()).hexdigest(),
        )

    def facts(self) -> dict[str, str]:
        """List its facts in words, by name; unknown ones are left out."""
        facts = {
            "finished": self.finished.isoformat(timespec="seconds"),
            "host": self.host,
            "platform": self.platform,
            "Python": self.python,
            **self.libraries,
            "revision": self.revision,
            "image": self.image,
            "robot description": self.robot_sha256 and f"SHA-256 {self.robot_sha256}",
            "steps of the engine": self.steps,
            "simulations": None if self.simulations is None else str(self.simulations),
            "session": self.session and f"clients of {self.session}; no function of `config.yaml`",
            "wall time": None if self.wall_s is None else f"{self.wall_s:.1f} s",
            "open": _OPEN if self.was_open else None,
        }
        return {name: fact for name, fact in facts.items() if fact}


def write_provenance(directory: Path, provenance: Provenance) -> None:
    """Write how a dataset was collected; its data card is there already."""
    document = _JSON.dump_python(provenance, mode="json") | {_CARD_HASH: entry_of_file(directory / CARD).sha256}
    write_file(directory / PROVENANCE, _seal(document).encode())


def read_provenance(directory: Path) -> Provenance | None:
    """Read how a dataset was collected; None if the file is damaged or missing."""
    with suppress(DatasetError):
        return _load(directory / PROVENANCE)[0]
    return None


def find_changes(directory: Path) -> Iterator[Finding]:
    """Find changed bytes of the provenance of a dataset and of its data card."""
    try:
        _, card = _load(directory / PROVENANCE)
        if (directory / CARD).exists() and entry_of_file(directory / CARD).sha256 != card:
            yield Finding(CARD, "", f"its bytes were changed: its SHA-256 is not the one in {PROVENANCE}")
    except DatasetError as error:
        yield Finding.of(error.path.name if error.path else PROVENANCE, error)


def _load(path: Path) -> tuple[Provenance, str]:
    """Read the provenance and the hash of the data card; a changed byte of the file is an error."""
    text = read_text(path, most_bytes=_MOST_BYTES)
    try:
        document = json.loads(text)
        del document[_OWN_HASH]
        card = str(document.pop(_CARD_HASH))
        provenance = _JSON.validate_python(document)
        if _seal(document | {_CARD_HASH: card}) == text:
            return provenance, card
    except (ValueError, LookupError, TypeError, RecursionError) as error:
        raise DatasetError("is damaged", path=path) from error
    raise DatasetError("its bytes were changed: it does not have the SHA-256 that it states", path=path)


def _seal(document: Mapping[str, Any]) -> str:
    """Write a document in JSON, with the SHA-256 of its text as the last line."""
    digest = hashlib.sha256(json.dumps(document, indent=2).encode()).hexdigest()
    return json.dumps({**document, _OWN_HASH: digest}, indent=2) + "\n"


@cache
def _read_revision() -> str | None:
    """Find the Git revision of the clone that these sources lie in; None if there is none, or no git."""
    root = Path(__file__).parents[3]
    if not (root / ".git").exists():
        return None
    # The configuration of a foreign clone may name programs that git would run. Without tags, `--always` gives the
    # whole hash of the revision.
    words = ["-c", "core.fsmonitor=false", "describe", "--always", "--abbrev=40", "--dirty", "--exclude=*"]
    with suppress(OSError, subprocess.SubprocessError):
        described = subprocess.run(["git", "-C", root, *words], capture_output=True, text=True, timeout=5, check=True)
        return described.stdout.strip() or None
    return None


def _describe_steps(engine: str) -> str | None:
    # A machine that only coordinates has no engines.
    with suppress(ThrowcollectError, ImportError):
        return load_member("engines", engine).describe_steps() or None
    return None


@cache
def find_versions() -> Mapping[str, str]:
    """Find the versions of the product and of the installed libraries that the data pass through."""
    versions = {"throwcollect": __version__}
    for name in _LIBRARIES:
        # A machine that only coordinates has no engines.
        with suppress(PackageNotFoundError):
            versions[name] = version(name)
    return versions


_JSON = TypeAdapter(Provenance)
