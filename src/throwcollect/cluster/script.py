"""The batch scripts of a collection: what a task of the array runs, and what joins the slices.

They are for people, too: whoever wants to, reads them, changes them and submits them by hand.
"""

from __future__ import annotations

import math
import re
import shlex
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from throwcollect.cluster.slurm import MARK
from throwcollect.cluster.submission import CLUSTER
from throwcollect.config.cluster import ClusterConfig
from throwcollect.config.schema import Config
from throwcollect.dataset.directory import PLAN
from throwcollect.errors import Interrupted

_ENDING_S = 30
"""What a task needs besides `run.grace_s` to end in order: nodes end, files are closed."""
_JOIN_MEMORY = "4G"
_EXPANDED = re.compile(r"\$SLURM_|cluster\.scratch=|--bind=\$|tcp/0\.0\.0\.0:\$PORT$")


@dataclass(frozen=True)
class BatchScripts:
    """Makes the scripts of one dataset.

    Attributes:
        config: Its configuration.
        directory: Its directory, absolute.
        logs: Where the tasks write their logs.
        program: Words that stand for the ``throwcollect`` command outside of an image.
        image: Image that tasks run in, absolute; None for none.
    """

    config: Config
    directory: Path
    logs: Path
    program: Sequence[str]
    image: Path | None

    def collect(self, tasks: int, indexes: str) -> str:
        """Text of the script of a task.

        Args:
            tasks: Number of slices.
            indexes: Which of them, as ``sbatch --array`` takes them.
        """
        cluster = self.config.cluster
        directives = {
            "job-name": f"throwcollect-{self.config.name}",
            "array": indexes + (f"%{cluster.at_once}" if cluster.at_once else ""),
            "output": self._output("%A_%a.log"),
            "cpus-per-task": cluster.cores,
            "mem": cluster.memory,
            "time": cluster.time,
            # To the step alone, so that this script lives on and can have the task queued again.
            "signal": self._signal,
        }
        collected = [
            *("up", "--slice", f"$SLURM_ARRAY_TASK_ID/{tasks}", "--output", str(self.directory)),
            *("-n", str(cluster.cores), "--runtime", "local"),
            *(("--set", f"cluster.scratch={cluster.scratch}") if cluster.scratch else ()),
        ]
        flag = "--requeue" if cluster.requeue else "--no-requeue"
        return "\n".join(
            [
                "#!/bin/bash",
                f"# Collects one slice of {tasks} of a dataset of throwcollect.",
                *self._directives(directives, cluster),
                f"#SBATCH {flag}",
                *self._start(cluster),
                "",
                "# As a step, so that signals reach it.",
                self._step(collected, cores=cluster.cores),
                "code=$?",
                # The id of its last task is that of an array, too, and would have all of them queued again.
                *_requeue(cluster.requeue, "${SLURM_ARRAY_JOB_ID}_$SLURM_ARRAY_TASK_ID"),
                "exit $code",
                "",
            ]
        )

    def live(self, nodes: int) -> str:
        """Text of the script of one run on several nodes: the first has the coordinator, and the others join it.

        Args:
            nodes: Number of nodes.
        """
        cluster = self.config.cluster
        directives = {
            "job-name": f"throwcollect-{self.config.name}",
            "output": self._output("%j_live.log"),
            "nodes": nodes,
            "ntasks": nodes,
            "ntasks-per-node": 1,
            "cpus-per-task": cluster.cores,
            "mem": cluster.memory,
            "time": cluster.time,
            "signal": self._signal,
        }
        token = str(self.directory / CLUSTER / "token")
        begin = [
            *("up", "--resume", str(self.directory), "-n", str(cluster.cores), "--runtime", "local"),
            *("--listen", "tcp/0.0.0.0:$PORT", "--token-file", token),
        ]
        join = ["join-run", "-", "-n", str(cluster.cores)]
        return "\n".join(
            [
                "#!/bin/bash",
                f"# Collects a dataset of throwcollect in one run on {nodes} nodes.",
                *self._directives(directives, cluster),
                "#SBATCH --no-kill",
                f"#SBATCH {'--requeue' if cluster.requeue else '--no-requeue'}",
                *self._start(cluster),
                "",
                "export PORT=$((20000 + SLURM_JOB_ID % 20000))",
                f"rm -f {shlex.quote(token)}",
                "# The first task begins the run; the others go on without one that is lost.",
                f"srun --no-kill --kill-on-bad-exit=0 --cpus-per-task={cluster.cores} bash -c '",
                'if [ "$SLURM_PROCID" = 0 ]; then',
                f"    exec {_inside_quotes(self._words(begin))}",
                "fi",
                f"until [ -s {_inside_quotes(shlex.quote(token))} ]; do sleep 0.5; done",
                f"exec {_inside_quotes(self._words(join))} < {_inside_quotes(shlex.quote(token))}",
                "'",
                "code=$?",
                f"rm -f {shlex.quote(token)}",
                *_requeue(cluster.requeue, "$SLURM_JOB_ID"),
                "exit $code",
                "",
            ]
        )

    def join(self) -> str:
        """Text of the script that joins the slices."""
        cluster = self.config.cluster
        directives = {
            "job-name": f"throwcollect-{self.config.name}-join",
            "output": self._output("%j_join.log"),
            "cpus-per-task": 1,
            "mem": cluster.memory and _JOIN_MEMORY,
            "time": cluster.time,
        }
        return "\n".join(
            [
                "#!/bin/bash",
                "# Joins the slices of a dataset of throwcollect.",
                *self._directives(directives, cluster),
                "#SBATCH --requeue",
                *self._start(cluster),
                "",
                self._step(["join", str(self.directory)], cores=1),
                "",
            ]
        )

    @property
    def _signal(self) -> str:
        return f"TERM@{math.ceil(self.config.run.grace_s) + _ENDING_S}"

    def _output(self, name: str) -> str:
        return f"{str(self.logs).replace('%', '%%')}/{name}"

    def _directives(self, own: dict[str, object], cluster: ClusterConfig) -> Iterator[str]:
        shared = {
            "partition": cluster.partition,
            "account": cluster.account,
            "qos": cluster.qos,
            "constraint": cluster.constraint,
            "comment": f"{MARK}{self.directory}",
            "open-mode": "append",
            "nodes": 1,
            "ntasks": 1,
        }
        for name, value in {**shared, **own}.items():
            if value is not None:
                text = str(value)
                yield f"#SBATCH --{name}={text if _plain(text) else _quote(text)}"

    def _start(self, cluster: ClusterConfig) -> Iterator[str]:
        yield from cluster.lines
        yield from (f"module load {shlex.quote(module)}" for module in cluster.modules)
        plan = shlex.quote(str(self.directory / PLAN))
        yield f"if ! [ -r {plan} ]; then"
        question = "is it on a file system that all nodes share?"
        yield f'    echo "throwcollect: $(hostname) does not see" {plan}": {question}" >&2'
        yield "    exit 2"
        yield "fi"

    def _step(self, words: Sequence[str], *, cores: int) -> str:
        return f"srun --ntasks=1 --cpus-per-task={cores} {self._words(words)}"

    def _words(self, words: Sequence[str]) -> str:
        """A command of throwcollect as the shell takes it, in the image if there is one."""
        program = list(self.program)
        if self.image is not None:
            bound = [str(self.directory), *self.config.cluster.binds, *filter(None, [self.config.cluster.scratch])]
            binds = [f"--bind={bind}" for bind in bound]
            program = ["apptainer", "--quiet", "exec", "--cleanenv", *binds, str(self.image), "throwcollect"]
        return " ".join(_in_shell(word) for word in (*program, *words))


def _requeue(times: int, job: str) -> Iterator[str]:
    if times:
        yield f"# {Interrupted.exit_code}: it was stopped in order, and goes on where it is started again."
        yield f'if [ $code = {Interrupted.exit_code} ] && [ "${{SLURM_RESTART_COUNT:-0}}" -lt {times} ]; then'
        yield f'    scontrol requeue "{job}"'
        yield "fi"


def _in_shell(word: str) -> str:
    """A word in the shell; variables stand for their values where a task or the scratch directory is named."""
    if "$" in word and _EXPANDED.match(word):
        return f'"{word}"'
    return shlex.quote(word)


def _inside_quotes(text: str) -> str:
    """A part of a command within a word in single quotes."""
    return text.replace("'", "'\\''")


def _plain(text: str) -> bool:
    return shlex.quote(text) == text or not set(text) & set(" \t\"'\\#")


def _quote(text: str) -> str:
    """A value of an option in a script, as sbatch reads it."""
    return '"' + text.replace("\\", "\\\\").replace('"', '\\"') + '"'
