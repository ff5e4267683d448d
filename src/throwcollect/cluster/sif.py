"""Checks a SIF, the image that Apptainer runs, before tasks are submitted that run in it."""

from __future__ import annotations

import json
import subprocess
from pathlib import Path

from throwcollect.errors import ConfigError, WorkerError
from throwcollect.runtimes.image_sources import SOURCES_LABEL, UNKNOWN, VERSION_LABEL, are_others
from throwcollect.version import __version__

SIF_COMMAND = "make sif"
"""Command that makes the SIF of this version, in a clone of the project."""


def check_sif(sif: Path) -> None:
    """Make sure that a SIF holds the throwcollect that is installed here, because another may collect other bytes.

    A SIF without labels is accepted.
    """
    labels = _read_labels(sif)
    hint = f"{SIF_COMMAND}, in a clone of the project, makes one"
    if (version := labels.get(VERSION_LABEL, UNKNOWN)) not in (UNKNOWN, __version__):
        raise ConfigError(f"{sif}: holds throwcollect {version}, and this is {__version__}", hint=hint)
    if are_others(labels.get(SOURCES_LABEL)):
        raise ConfigError(f"{sif}: was made from other sources than these", hint=hint)


def _read_labels(sif: Path) -> dict[str, str]:
    answer = subprocess.run(
        ["apptainer", "--nocolor", "inspect", "--json", sif], capture_output=True, text=True, check=False
    )
    if answer.returncode:
        raise WorkerError(f"{sif}: its labels cannot be read", evidence=answer.stderr.strip() or None)
    labels: dict[str, str] = json.loads(answer.stdout)["data"]["attributes"].get("labels") or {}
    return labels
