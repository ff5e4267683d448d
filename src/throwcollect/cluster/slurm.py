"""Slurm by its commands: what is submitted, what became of it, and its own words where it refuses."""

from __future__ import annotations

import os
import subprocess
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from throwcollect.errors import ConfigError, WorkerError

MARK = "throwcollect:"
"""Begins the comment of our jobs; the directory of the dataset follows."""

_PATIENCE_S = 60.0
_GLANCE_S = 5.0
"""The same for commands that only look whether there is something."""
_RUNNING = frozenset({"RUNNING", "COMPLETING", "SIGNALING"})
_ENDED = frozenset(
    [
        "BOOT_FAIL",
        "CANCELLED",
        "COMPLETED",
        "DEADLINE",
        "FAILED",
        "NODE_FAIL",
        "OUT_OF_MEMORY",
        "PREEMPTED",
        "REVOKED",
        "TIMEOUT",
    ]
)
"""All others, of which new versions of Slurm have more, are those of tasks that run or will."""
_UNSEEN_OUTPUT = "0:53"
"""Exit code of a task whose log could not be opened: its node does not see the directory."""


@dataclass(frozen=True)
class Task:
    """One task of an array, or a job that is none.

    Attributes:
        index: Its index in the array; None for a job that is no array.
        state: State of Slurm, such as ``PENDING`` or ``RUNNING``.
        node: Where it runs or ran; empty if nowhere.
        reason: Why it waits, or the exit code that it ended with, as Slurm says it.
    """

    index: int | None
    state: str
    node: str
    reason: str

    @property
    def lives(self) -> bool:
        """Whether it runs, or will."""
        return self.state not in _ENDED

    @property
    def runs(self) -> bool:
        """Whether it is on a node."""
        return self.state in _RUNNING

    @property
    def saw_no_directory(self) -> bool:
        """Whether it ended before its first line, as its node does not see the directory of its log."""
        return self.state == "FAILED" and self.reason == _UNSEEN_OUTPUT


def submit(script: Path, *options: str) -> str:
    """Submit a batch script.

    Args:
        script: The script.
        options: Options of ``sbatch`` besides those in the script.

    Returns:
        Number of the job.

    Raises:
        ConfigError: If there is no Slurm here.
        WorkerError: If Slurm refuses it.
    """
    return _run("sbatch", "--parsable", *options, str(script)).strip().partition(";")[0]


def check(script: Path) -> None:
    """Ask Slurm whether it would take a batch script; nothing is submitted.

    Args:
        script: The script.

    Raises:
        ConfigError: If there is no Slurm here, or it would refuse the script.
    """
    try:
        _run("sbatch", "--test-only", str(script))
    except WorkerError as error:
        raise ConfigError(error.message, hint="the keys of the section cluster become options of the script") from error


def find_tasks(job: str) -> tuple[Task, ...]:
    """The tasks of a job that Slurm remembers: those that live, and those that ended some minutes ago.

    Args:
        job: Number of the job.

    Raises:
        ConfigError: If there is no Slurm here.
        WorkerError: If it does not answer.
    """
    # A job that is long forgotten is an error for squeue; all jobs of this user are none.
    format_ = "%F|%K|%T|%N|%r"
    lines = _run("squeue", "--noheader", "--array", "--me", "--states=all", f"--format={format_}").splitlines()
    rows = (line.strip().split("|") for line in lines)
    found = [Task(_index(index), state, node, reason) for of, index, state, node, reason in rows if of == job]
    return tuple(found)


def find_ended(job: str) -> dict[int | None, Task]:
    """The tasks of a job that ended, by index: as accounting has them, or as the controller still remembers them.

    Args:
        job: Number of the job.

    Raises:
        ConfigError: If there is no Slurm here.
    """
    ended: dict[int | None, Task] = {}
    try:
        text = _run("scontrol", "--oneliner", "show", "job", job)
    except WorkerError:
        text = ""
    for line in text.splitlines():
        facts = dict(word.split("=", 1) for word in line.split() if "=" in word)
        for index in _indexes(facts.get("ArrayTaskId", "")):
            task = Task(index, facts["JobState"], facts.get("NodeList", ""), facts["ExitCode"])
            if not task.lives:
                ended[index] = task
    return ended | _find_accounted(job)


def _find_accounted(job: str) -> dict[int | None, Task]:
    try:
        text = _run(
            "sacct", "--noheader", "--parsable2", "-X", f"--jobs={job}", "--format=JobID,State,NodeList,ExitCode"
        )
    except (WorkerError, ConfigError):
        return {}  # accounting is often off
    found = {}
    for line in text.splitlines():
        name, state, node, code = line.split("|")
        task = Task(_index(name.partition("_")[2]), state.partition(" ")[0], node, code)
        if not task.lives:
            found[task.index] = task
    return found


def find_directories() -> dict[str, str]:
    """Directories of the datasets that jobs of this user in the queue collect, by the job's number.

    Raises:
        ConfigError: If there is no Slurm here.
        WorkerError: If it does not answer.
    """
    lines = _run("squeue", "--noheader", "--me", "--format=%F|%k", patience_s=_GLANCE_S).splitlines()
    rows = (line.strip().partition(f"|{MARK}") for line in lines)
    return {job: directory for job, mark, directory in rows if mark}


def cancel(jobs: Sequence[str]) -> None:
    """End jobs, or single tasks of arrays as ``JOB_INDEX``; those that have ended are left alone.

    Raises:
        ConfigError: If there is no Slurm here.
        WorkerError: If it does not answer.
    """
    _run("scancel", "--quiet", *jobs)


def find_largest_array() -> int | None:
    """Largest number of tasks that an array may have; None if Slurm does not say.

    Raises:
        ConfigError: If there is no Slurm here.
        WorkerError: If it does not answer.
    """
    for line in _run("scontrol", "show", "config").splitlines():
        name, _, value = line.partition("=")
        if name.strip() == "MaxArraySize" and value.strip().isdigit():
            return int(value)
    return None


def _indexes(text: str) -> list[int | None]:
    """The indexes of array tasks, which may be those of several: ``4``, ``4-7%2``, ``1,4-7``; one job has none."""
    found: list[int | None] = []
    for part in text.partition("%")[0].split(","):
        first, _, last = part.partition("-")
        if first.isdigit():
            found += range(int(first), int(last if last.isdigit() else first) + 1)
    return found or [None]


def _index(text: str) -> int | None:
    return int(text) if text.isdigit() else None


def _run(program: str, *arguments: str, patience_s: float = _PATIENCE_S) -> str:
    """What a command of Slurm prints.

    Raises:
        ConfigError: If there is no such command.
        WorkerError: If it fails; its own words are the evidence.
    """
    try:
        done = subprocess.run(
            [program, *arguments],
            stdin=subprocess.DEVNULL,
            capture_output=True,
            text=True,
            timeout=patience_s,
            check=False,
            # Its tables and times in one form, whatever the user has set.
            env={**{k: v for k, v in os.environ.items() if not k.startswith(("SQUEUE_", "SACCT_"))}, "LC_ALL": "C"},
        )
    except FileNotFoundError as error:
        raise ConfigError(
            f"{program} is not there: this is no machine that submits to Slurm",
            hint="run this on a login node, or see docs/cluster.md for other schedulers",
        ) from error
    except subprocess.TimeoutExpired as error:
        raise WorkerError(f"{program} has not answered within {patience_s:g} s") from error
    if done.returncode:
        said = [line for line in done.stderr.splitlines() if line.strip()]
        raise WorkerError(f"{program} refuses: {'; '.join(said) or f'exit code {done.returncode}'}")
    return done.stdout
