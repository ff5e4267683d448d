"""The record of submitted jobs in the directory of a dataset, and what Slurm says of these jobs."""

from __future__ import annotations

from pathlib import Path

import pytest

from throwcollect.collect.cluster import slurm
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


def answer(monkeypatch: pytest.MonkeyPatch, directory: Path, **programs: str) -> None:
    """Replace commands of Slurm by scripts that print these texts."""
    for name, text in programs.items():
        path = directory / name
        path.write_text(f"#!/bin/sh\ncat <<'END'\n{text}\nEND\n")
        path.chmod(0o755)
    monkeypatch.setenv("PATH", f"{directory}:/usr/bin:/bin")


def test_the_queue_is_read_task_by_task(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    rows = ["12|0|RUNNING|n1|None", "12|1|PENDING||Priority", "12|2|FAILED|n2|NonZeroExitCode", "99|0|RUNNING|n1|None"]
    answer(monkeypatch, tmp_path, squeue="\n".join([*rows, "13|N/A|PENDING||Dependency"]))
    found = slurm.find_tasks()
    assert [(task.index, task.state, task.lives) for task in found["12"]] == [
        (0, "RUNNING", True),
        (1, "PENDING", True),
        (2, "FAILED", False),
    ]
    (joining,) = found["13"]
    assert (joining.index, joining.reason) == (None, "Dependency")


def test_the_end_of_a_task_comes_from_accounting_or_else_from_the_controller(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    lines = [
        "JobId=14 ArrayJobId=12 ArrayTaskId=0 JobState=FAILED ExitCode=4:0 NodeList=n1",
        "JobId=12 ArrayJobId=12 ArrayTaskId=2,4-6%3 JobState=CANCELLED ExitCode=0:15 NodeList=",
        "JobId=15 ArrayJobId=12 ArrayTaskId=1 JobState=RUNNING ExitCode=0:0 NodeList=n2",
        "JobId=16 ArrayJobId=12 ArrayTaskId=3 JobState=FAILED ExitCode=0:53 NodeList=n3",
    ]
    answer(
        monkeypatch, tmp_path, scontrol="\n".join(lines), sacct="12_0|OUT_OF_MEMORY|n1|0:125\n12_2|CANCELLED by 0||0:0"
    )
    ended = slurm.find_ended("12")
    assert {index: task.state for index, task in ended.items()} == {
        0: "OUT_OF_MEMORY",
        2: "CANCELLED",
        3: "FAILED",
        **dict.fromkeys((4, 5, 6), "CANCELLED"),
    }
    assert ended[3].saw_no_directory
    assert not ended[0].saw_no_directory
