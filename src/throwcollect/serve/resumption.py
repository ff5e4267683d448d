"""Decides whether clients may continue the dataset of a run that is over."""

from __future__ import annotations

import os
from collections.abc import Callable
from functools import lru_cache
from pathlib import Path

from throwcollect.coordinator.resume import is_complete
from throwcollect.dataset.directory import CONFIG, METADATA
from throwcollect.errors import ConflictError
from throwcollect.runs.run import Run
from throwcollect.wording import command


def check_resumption(run: Run, *, is_complete: Callable[[Path], bool] = is_complete) -> None:
    """Check that clients may continue the dataset of a run.

    Args:
        run: The run, as it is now.
        is_complete: Returns whether nothing is left to collect into a directory.
    """
    directory = run.context.directory
    if run.status == "running":
        raise ConflictError(f"run {run.id} is still running")
    if run.record.kind != "collection" or not os.path.isfile(directory / CONFIG):
        raise ConflictError(f"run {run.id} has no dataset in a directory to go on with")
    if is_complete(directory):
        raise ConflictError(
            f"the dataset of run {run.id} is complete",
            hint=f"{command('resume', directory, '--trials', 'K')} adds trials",
        )


def can_be_resumed(run: Run) -> bool:
    """Whether clients may continue the dataset of a run; cheap enough to be called again and again.

    A run that has finished its dataset counts as complete, although files may have been lost since.
    """
    if run.record.exit_code == 0:
        return False
    try:
        check_resumption(run, is_complete=_is_complete_by_now)
    except ConflictError:
        return False
    return True


def _is_complete_by_now(directory: Path) -> bool:
    """Whether a dataset is complete; its tables are read again only if files were added, removed or replaced."""
    try:
        changed_ns = directory.stat().st_mtime_ns, (directory / METADATA).stat().st_mtime_ns
    except OSError:
        return False
    return _is_complete(directory, changed_ns)


@lru_cache(maxsize=1024)
def _is_complete(directory: Path, _changed_ns: tuple[int, int]) -> bool:
    return is_complete(directory)
