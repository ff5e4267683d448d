"""Writes the batch scripts of a collection: for the tasks of the array, and for the job that joins the slices.

Users may read the scripts, change them and submit them by hand.
"""

from __future__ import annotations

import math
import shlex
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from throwcollect.config.schema import Config
from throwcollect.errors import Interrupted

_ENDING_S = 30
"""Time that a task needs, besides `run.grace_s`, to shut down: to end nodes and close files."""
_JOIN_MEMORY = "4G"


@dataclass(frozen=True)
class BatchScripts:
    """Makes the scripts of one dataset, whose paths are absolute.

    Attributes:
        logs: Directory of the logs of tasks.
        program: Words that start ``throwcollect`` outside of an image.
        image: Image that tasks run in; None for none.
    """

    config: Config
    directory: Path
    logs: Path
    program: Sequence[str]
    image: Path | None

    def collect(self, tasks: int, indexes: str) -> str:
        """Write the script of a task that collects a slice, for indexes of slices as ``sbatch --array`` takes them."""
        cluster, stopped = self.config.cluster, Interrupted.exit_code
        directives: dict[str, object] = {
            "array": indexes + (f"%{cluster.at_once}" if cluster.at_once else ""),
            "output": self._name_output("%A_%a.log"),
        }
        words = [
            *("up", "--slice", f"$SLURM_ARRAY_TASK_ID/{tasks}", "--output", str(self.directory)),
            *("-n", str(cluster.cores), "--runtime", "local"),
        ]
        return self._write(
            f"Collects one slice of {tasks} of a dataset of throwcollect.",
            directives,
            "--requeue" if cluster.requeue else "--no-requeue",
            "# As a step, so that signals reach it.",
            self._write_step(words, cores=cluster.cores),
            "code=$?",
            f"# {stopped}: it was stopped, and goes on where it left off when it is started again.",
            f'if [ $code = {stopped} ] && [ "${{SLURM_RESTART_COUNT:-0}}" -lt {cluster.requeue} ]; then',
            # SLURM_JOB_ID of the last task is the id of the whole array, all of which would be queued again.
            '    scontrol requeue "${SLURM_ARRAY_JOB_ID}_$SLURM_ARRAY_TASK_ID"',
            "fi",
            "exit $code",
        )

    def join(self) -> str:
        """Write the script that joins the slices."""
        directives = {
            "job-name": f"throwcollect-{self.config.name}-join",
            "output": self._name_output("%j_join.log"),
            "cpus-per-task": 1,
            "mem": self.config.cluster.memory and _JOIN_MEMORY,
            "signal": None,
        }
        step = self._write_step(["join", str(self.directory)], cores=1)
        return self._write("Joins the slices of a dataset of throwcollect.", directives, "--requeue", step)

    def _write(self, purpose: str, directives: dict[str, object], flag: str, *commands: str) -> str:
        """Write a script: the options for Slurm, what all scripts begin with, and then its own commands."""
        head = [
            "#!/bin/bash",
            f"# {purpose}",
            *self._list_directives(directives),
            f"#SBATCH {flag}",
        ]
        return "\n".join([*head, *self._list_opening_lines(), "", *commands, ""])

    def _name_output(self, name: str) -> str:
        # Slurm replaces patterns such as %j in names of logs, and takes %% for a percent sign.
        return f"{str(self.logs).replace('%', '%%')}/{name}"

    def _list_directives(self, own: dict[str, object]) -> Iterator[str]:
        """List the options for Slurm: those that all scripts have, unless a script has its own, and further ones."""
        cluster = self.config.cluster
        shared = {
            "partition": cluster.partition,
            "account": cluster.account,
            "qos": cluster.qos,
            "constraint": cluster.constraint,
            "comment": f"throwcollect:{self.directory}",
            "open-mode": "append",
            "nodes": 1,
            "ntasks": 1,
            "job-name": f"throwcollect-{self.config.name}",
        }
        resources = {
            "cpus-per-task": cluster.cores,
            "mem": cluster.memory,
            "time": cluster.time,
            # Without the letter B, Slurm signals the step alone: the script lives on, and can queue the task again.
            "signal": f"TERM@{math.ceil(self.config.run.grace_s) + _ENDING_S}",
        }
        # What a script has of its own wins, wherever it stands.
        for name, value in {**shared, **own, **resources, **own}.items():
            if value is not None:
                yield f"#SBATCH --{name}={_quote(str(value))}"

    def _list_opening_lines(self) -> Iterator[str]:
        yield from self.config.cluster.lines
        yield from (f"module load {shlex.quote(module)}" for module in self.config.cluster.modules)

    def _write_step(self, words: Sequence[str], *, cores: int) -> str:
        return f"srun --ntasks=1 --cpus-per-task={cores} {self._write_command(words)}"

    def _write_command(self, words: Sequence[str]) -> str:
        """Write a command of throwcollect for the shell, in the image if there is one."""
        if self.image is None:
            return " ".join(map(_quote_for_shell, (*self.program, *words)))
        binds = [shlex.quote(f"--bind={bind}") for bind in (self.directory, *self.config.cluster.binds)]
        image = shlex.quote(str(self.image))
        return " ".join(
            ["apptainer --quiet exec --cleanenv", *binds, image, "throwcollect", *map(_quote_for_shell, words)]
        )


def _quote_for_shell(word: str) -> str:
    """Quote a word for the shell, which replaces variables of Slurm alone."""
    return f'"{word}"' if word.startswith("$SLURM_") else shlex.quote(word)


def _quote(text: str) -> str:
    """Quote the value of an option as sbatch reads it, if it has to be."""
    if shlex.quote(text) == text or not set(text) & set(" \t\"'\\#"):
        return text
    return '"' + text.replace("\\", "\\\\").replace('"', '\\"') + '"'
