"""Keeps rounds that were added to a plan beside the plan's file, until that file is written again as a whole.

The file ``plan.rounds.part`` has a line of JSON for each round, so adding one costs the same however long the plan is.
A line without a line end is incomplete, because its writer was killed; none of its trials has begun.
"""

from __future__ import annotations

import json
import os
from pathlib import Path

import numpy as np

from throwcollect.errors import DatasetError
from throwcollect.files import is_there, open_regular, sync_directory, unreadable, unwritable, write_all
from throwcollect.sweep.digest import is_digest
from throwcollect.sweep.points import Points
from throwcollect.sweep.trials import DIGEST_BYTES, Trials


def rounds_path(plan: Path) -> Path:
    """Name the file of the rounds that are not yet in the file of a plan."""
    return plan.with_name(f"{plan.stem}.rounds.part")


def append_round(plan: Path, trials: Trials) -> None:
    """Add a round, which follows the trials on disk, to a plan, whole or not at all; it then survives a power cut."""
    path = rounds_path(plan)
    line = {
        "first": trials.first,
        "values": trials.values.tolist(),
        "seeds": trials.seeds.tolist(),
        "digests": [digest.tobytes().hex() for digest in trials.digests],
        "refused": [trials.refused.get(number) for number in trials.numbers],
    }
    try:
        exists = is_there(path)
        # No incomplete line can be at the end: whoever opens a dataset takes an existing file of rounds into the plan
        # first.
        descriptor = open_regular(path, os.O_WRONLY | os.O_CREAT | os.O_APPEND)
        try:
            write_all(descriptor, json.dumps(line).encode() + b"\n")
            os.fsync(descriptor)
        finally:
            os.close(descriptor)
        if not exists:
            # A new file survives a power cut only if the directory with its name does.
            sync_directory(path.parent)
    except OSError as error:
        raise unwritable(path, error) from error


def read_rounds(plan: Path, trials: Trials) -> None:
    """Append the rounds that lie beside the file of a plan to `trials`, which were read from the file.

    Rounds that are in the file already are skipped.
    """
    path = rounds_path(plan)
    if not is_there(path):
        return
    try:
        with open(open_regular(path), "rb") as lines:
            for number, line in enumerate(lines, 1):
                if line.endswith(b"\n"):
                    _append_line(line, trials, path, number)
    except OSError as error:
        raise unreadable(path, error) from error


def _append_line(line: bytes, trials: Trials, path: Path, number: int) -> None:
    try:
        added = _parse(line, trials.keys)
        # If a process wrote the whole plan and was killed before it removed this file, the plan has the rounds already.
        if added.numbers.stop > trials.numbers.stop:
            trials.extend(added)
    except (ValueError, KeyError, TypeError, OverflowError, RecursionError) as error:
        raise DatasetError("is damaged: no round of this plan", path=path, place=f"line {number}") from error


def _parse(line: bytes, keys: tuple[str, ...]) -> Trials:
    """Read the trials of a line."""
    entry = json.loads(line)
    count = len(entry["seeds"])
    if not all(map(is_digest, entry["digests"])):
        raise ValueError("no digests")
    digests = np.frombuffer(bytes.fromhex("".join(entry["digests"])), np.uint8)
    trials = Trials(
        Points(keys, np.array(entry["values"], np.float64).reshape(count, len(keys))),
        np.array(entry["seeds"], np.uint64),
        digests.reshape(count, DIGEST_BYTES),
        first=int(entry["first"]),
    )
    return trials.refuse([None if reason is None else str(reason) for reason in entry["refused"]])
