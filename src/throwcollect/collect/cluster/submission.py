"""The record of what was submitted for a dataset; any machine that sees the dataset's directory can go on with it."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from pydantic import TypeAdapter, ValidationError

from throwcollect.errors import ConfigError
from throwcollect.files import write_file
from throwcollect.plan.slice import Slice

CLUSTER = "cluster"
"""Name of the directory of scripts and logs, inside the directory of a dataset."""

LOGS = "logs"
"""Name of the directory of logs in it."""
_FILE = "submission.json"


@dataclass(frozen=True)
class Job:
    """An array that was submitted, and the job that joins the slices after it.

    Attributes:
        array: Number of the array; empty if the slices were only to be joined.
        join: Number of the joining job.
        slices: Indexes of the slices that the array collects.
    """

    array: str
    join: str
    slices: tuple[int, ...]


@dataclass(frozen=True)
class Submission:
    """Everything that was submitted for a dataset.

    Attributes:
        tasks: Number of slices.
        program: Words that start ``throwcollect`` outside of an image.
        image: Image that tasks run in; None for none.
        jobs: The jobs, in the order in which they were submitted.
    """

    tasks: int
    program: tuple[str, ...]
    image: str | None
    jobs: tuple[Job, ...] = ()

    @property
    def slices(self) -> tuple[Slice, ...]:
        """All slices."""
        return Slice.all_of(self.tasks)


_JSON = TypeAdapter(Submission)


def is_submitted(directory: Path) -> bool:
    """Whether something was submitted for a dataset."""
    return (directory / CLUSTER / _FILE).is_file()


def read_submission(directory: Path) -> Submission:
    """Read the record of a dataset."""
    path = directory / CLUSTER / _FILE
    try:
        return _JSON.validate_json(path.read_bytes())
    except (OSError, ValidationError) as error:
        raise ConfigError(f"{path}: does not record what was submitted: {error}") from error


def write_submission(directory: Path, submission: Submission) -> None:
    """Write the record of a dataset, whole or not at all."""
    write_file(directory / CLUSTER / _FILE, _JSON.dump_json(submission, indent=1) + b"\n")


def format_indexes(indexes: tuple[int, ...]) -> str:
    """Write indexes, which ascend, as ``sbatch --array`` takes them, such as ``0-4,7``."""
    ranges: list[list[int]] = []
    for index in indexes:
        if ranges and index == ranges[-1][1] + 1:
            ranges[-1][1] = index
        else:
            ranges.append([index, index])
    return ",".join(str(first) if first == last else f"{first}-{last}" for first, last in ranges)
