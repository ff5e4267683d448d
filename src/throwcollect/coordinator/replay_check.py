"""Simulates some trials again in a fresh process, before a collection counts as finished."""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Callable, Mapping
from pathlib import Path

from throwcollect.errors import DatasetError, WorkerError
from throwcollect.trial.choice import choose_trials
from throwcollect.wording import format_count


def check_by_replay(
    directory: Path, digests: Mapping[int, str], *, count: int, seed: int, meanwhile: Callable[[], None]
) -> str | None:
    """Compare episodes with what a process that knows nothing but configuration and plan makes of their trials.

    Args:
        directory: Directory of the dataset.
        digests: Digest of each episode, by trial.
        count: How many trials are simulated again.
        seed: Root seed of the collection, by which they are chosen.
        meanwhile: Called again and again while the process works.

    Returns:
        What was done, in words; None if nothing was to be done.

    Raises:
        DatasetError: If an episode came out otherwise.
        WorkerError: If the process failed.
    """
    trials = choose_trials(sorted(digests), count=count, seed=seed)
    if not trials:
        return None
    command = [sys.executable, "-m", "throwcollect", "simulate", str(directory), *map(str, trials)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
        while process.poll() is None:
            meanwhile()
        output, errors = process.communicate()
    if process.returncode:
        raise WorkerError(
            f"{format_count(len(trials), 'trial')} could not be simulated again (exit code {process.returncode})",
            evidence=errors.strip() or None,
        )
    again = {each["trial"]: each["digest"] for each in map(json.loads, output.splitlines())}
    wrong = [trial for trial in trials if again.get(trial) != digests[trial]]
    if wrong:
        raise DatasetError(
            f"{directory}: {len(wrong)} of {format_count(len(trials), 'trial')} came out otherwise in a fresh process: "
            f"trial {', '.join(map(str, wrong))}",
            evidence="\n".join(
                f"trial {trial}: {digests[trial]} in the dataset, {again.get(trial)}" for trial in wrong
            ),
            hint="this machine does not compute alike each time, or something has changed what was simulated",
        )
    return f"{format_count(len(trials), 'trial')} simulated again in a fresh process: the same bit for bit"
