"""The record of submitted jobs in the directory of a dataset, and what Slurm says of these jobs."""

from __future__ import annotations

from pathlib import Path

import pytest

from throwcollect.collect.cluster.submission import (
    Job,
    Submission,
    format_indexes,
    is_submitted,
    read_submission,
    write_submission,
)

SUBMISSION = Submission(
    tasks=8,
    program=("throwcollect",),
    image=None,
    jobs=(Job(array="12", join="13", slices=(0, 1, 5)),),
)


def test_a_submission_reads_back_equal_after_it_is_written(tmp_path: Path) -> None:
    assert not is_submitted(tmp_path)
    (tmp_path / "cluster").mkdir()
    write_submission(tmp_path, SUBMISSION)
    assert is_submitted(tmp_path)
    assert read_submission(tmp_path) == SUBMISSION


@pytest.mark.parametrize(
    ("indexes", "text"), [((0,), "0"), ((0, 1, 2), "0-2"), ((0, 2, 3, 7), "0,2-3,7"), (tuple(range(1000)), "0-999")]
)
def test_indexes_of_array_tasks_are_written_as_ranges(indexes: tuple[int, ...], text: str) -> None:
    assert format_indexes(indexes) == text
