"""Reads and checks the contents of a SIF, the file that Apptainer runs."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from throwcollect.errors import ConfigError
from throwcollect.files import unreadable
from throwcollect.runtimes.apptainer.program import call
from throwcollect.runtimes.image_sources import SOURCES_LABEL, UNKNOWN, VERSION_LABEL, are_others
from throwcollect.version import __version__
from throwcollect.wording import command

_MAGIC_AT = 32
"""The bytes before this position hold the line that names the program with which a shell runs such a file."""
_MAGIC = b"SIF_MAGIC\0"


def is_sif(path: Path) -> bool:
    """Whether a file is a SIF, judged by its first bytes."""
    with path.open("rb") as file:
        return file.read(_MAGIC_AT + len(_MAGIC))[_MAGIC_AT:] == _MAGIC


def read_labels(sif: Path) -> dict[str, str]:
    """Read the labels of a SIF; those that were not set are left out."""
    try:
        if not is_sif(sif):
            raise ConfigError(
                f"{sif}: is no SIF, the image that Apptainer runs", hint="throwcollect image sif makes one"
            )
    except (FileNotFoundError, IsADirectoryError) as error:
        raise ConfigError(f"{sif}: {error.strerror}", hint=f"{command('image', 'sif', '-o', sif)} makes it") from error
    except OSError as error:
        raise unreadable(sif, error) from error
    printed = call(f"{sif}: its labels cannot be read", "inspect", "--json", str(sif))
    return {name: label for name, label in _labels_of(json.loads(printed)).items() if label != UNKNOWN}


def check_sif(sif: Path) -> None:
    """Make sure that a SIF holds the throwcollect that is installed here, because another may collect other bytes.

    A SIF without labels is accepted.
    """
    labels = read_labels(sif)
    hint = f"{command('image', 'sif', '-o', sif)} makes it anew"
    if (version := labels.get(VERSION_LABEL, __version__)) != __version__:
        raise ConfigError(f"{sif}: holds throwcollect {version}, and this is {__version__}", hint=hint)
    if are_others(labels.get(SOURCES_LABEL)):
        raise ConfigError(f"{sif}: was made from other sources than these", hint=hint)


def _labels_of(document: Any) -> dict[str, str]:
    """Find the labels in the output of `inspect --json`; empty if it has an unknown form."""
    for name in ("data", "attributes", "labels"):
        document = document.get(name) if isinstance(document, dict) else None
    return document if isinstance(document, dict) else {}
