"""Decides whether clients may continue the dataset of a run that is over."""

from __future__ import annotations

import os
from functools import lru_cache
from pathlib import Path

from throwcollect.coordinator.resume import is_complete
from throwcollect.dataset.directory import CONFIG, METADATA
from throwcollect.runs.records import Run


def explain_refusal(run: Run) -> str | None:
    """Why clients cannot continue the dataset of a run; None if they can. This is cheap enough for many calls."""
    directory = run.place.directory
    if run.status == "running":
        return f"run {run.id} is still running"
    if run.record.kind != "collection" or run.record.volume is not None or not os.path.isfile(directory / CONFIG):
        return f"run {run.id} has no dataset in a directory to go on with"
    try:
        changed_ns = directory.stat().st_mtime_ns, (directory / METADATA).stat().st_mtime_ns
    except OSError:
        return None
    return f"the dataset of run {run.id} is complete" if _is_complete(directory, changed_ns) else None


# The tables of a dataset are read again only if files were added, removed or replaced.
@lru_cache(maxsize=1024)
def _is_complete(directory: Path, _changed_ns: tuple[int, int]) -> bool:
    return is_complete(directory)
