"""Calls the commands of Slurm: submits jobs, asks for their state, and passes on why Slurm refuses them."""

from __future__ import annotations

import os
import re
import subprocess
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from throwcollect.config.document import Document
from throwcollect.config.run import ClusterConfig
from throwcollect.errors import ConfigError, WorkerError

_PATIENCE_S = 60.0
"""Longest wait for a command of Slurm."""
_RUNNING = frozenset({"RUNNING", "COMPLETING", "SIGNALING"})
_ENDED = re.compile(
    "BOOT_FAIL|CANCELLED|COMPLETED|DEADLINE|FAILED|NODE_FAIL|OUT_OF_MEMORY|PREEMPTED|REVOKED|TIMEOUT",
)
"""States of tasks that have ended. All others, including those of future versions of Slurm, count as living."""
_UNSEEN_OUTPUT = ("JobLaunchFailure", "RaisedSignal:53")
"""Beginnings of the reason of a task whose log could not be opened: its node does not see the directory."""
_UNREACHED = ("Could not establish a configuration source", "Unable to contact slurm controller")
"""Parts of the messages of Slurm's commands if there is no controller, or it cannot be reached."""


@dataclass(frozen=True)
class ArrayTask:
    """One task of an array, or a job that is no array.

    Attributes:
        index: Its index in the array; None for a job that is no array.
        state: Its state in the words of Slurm, such as ``PENDING`` or ``RUNNING``.
        node: The node that it runs or ran on; empty if none.
        reason: The reason why it waits, or has ended, in the words of Slurm.
    """

    index: int | None
    state: str
    node: str
    reason: str

    @property
    def lives(self) -> bool:
        """Whether it runs, or waits to run."""
        return _ENDED.fullmatch(self.state) is None

    @property
    def runs(self) -> bool:
        """Whether it runs on a node."""
        return self.state in _RUNNING

    @property
    def saw_no_directory(self) -> bool:
        """Whether it ended before its first line, because its node does not see the directory of its log."""
        return self.state == "FAILED" and self.reason.startswith(_UNSEEN_OUTPUT)


def submit(script: Path, *options: str) -> str:
    """Submit a batch script, with further options of ``sbatch`` than those in the script.

    Returns:
        Number of the job.
    """
    try:
        # With several clusters, sbatch prints NUMBER;CLUSTER.
        return _run("sbatch", "--parsable", *options, str(script)).strip().partition(";")[0]
    except WorkerError as error:
        hint = f"correct the keys of cluster, by --set cluster.KEY=VALUE, in the YAML file or in {site_path()}"
        raise ConfigError(error.message, hint=error.hint or hint) from error


def find_tasks() -> dict[str, list[ArrayTask]]:
    """Find the tasks of this user, by number of the job: those that live, and those that ended some minutes ago."""
    # squeue would fail for a job that Slurm has forgotten, but never fails for all jobs of this user. Ask for number of
    # the array, index in it, state, node, and reason.
    format_ = "%F|%K|%T|%N|%r"
    found: dict[str, list[ArrayTask]] = {}
    for line in _run("squeue", "--noheader", "--array", "--me", "--states=all", f"--format={format_}").splitlines():
        job, index, state, node, reason = line.strip().split("|")
        found.setdefault(job, []).append(ArrayTask(int(index) if index.isdigit() else None, state, node, reason))
    return found


def cancel(jobs: Sequence[str]) -> None:
    """End jobs; those that have ended stay as they are."""
    _run("scancel", "--quiet", *jobs)


def _run(program: str, *arguments: str) -> str:
    """Run a command of Slurm, and return its output."""
    try:
        done = subprocess.run(
            [program, *arguments],
            stdin=subprocess.DEVNULL,
            capture_output=True,
            text=True,
            timeout=_PATIENCE_S,
            check=False,
            # These variables and the locale of the user would change the format of its output.
            env={**{k: v for k, v in os.environ.items() if not k.startswith("SQUEUE_")}, "LC_ALL": "C"},
        )
    except FileNotFoundError as error:
        raise ConfigError(
            f"{program} is missing: this machine cannot submit to Slurm",
            hint="run this on a login node, or see docs/running.md for other schedulers",
        ) from error
    except subprocess.TimeoutExpired as error:
        raise WorkerError(f"{program} has not answered within {_PATIENCE_S:g} s") from error
    if done.returncode:
        printed = [line for line in done.stderr.splitlines() if line.strip()]
        if any(words in line for words in _UNREACHED for line in printed):
            raise WorkerError(
                f"Slurm has no controller that {program} can reach: none is configured here, or it is down",
                hint="run this on a login node, or see docs/running.md for other schedulers",
            )
        raise WorkerError(f"{program} refuses: {'; '.join(printed) or f'exit code {done.returncode}'}")
    return done.stdout


def site_path() -> Path:
    """Name the path of the file, which need not exist."""
    home = os.environ.get("XDG_CONFIG_HOME") or Path.home() / ".config"
    return Path(home) / "throwcollect" / "cluster.yaml"


def with_site(cluster: ClusterConfig) -> ClusterConfig:
    """Complete the section `cluster` of a configuration by the user's file; keys that the section sets itself win."""
    path = site_path()
    if not path.is_file():
        return cluster
    site = Document(path).validate(ClusterConfig)
    own = {name: getattr(cluster, name) for name in cluster.model_fields_set}
    return site.model_copy(update=own)
