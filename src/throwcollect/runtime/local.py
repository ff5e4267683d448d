"""Nodes as processes of this machine."""

from __future__ import annotations

import ctypes
import os
import signal
import subprocess
import sys
import time
from collections import deque
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path

from throwcollect.errors import WorkerError

_PR_SET_PDEATHSIG = 1
"""prctl(2): the signal a process gets when its parent dies."""

_LIBC = ctypes.CDLL(None)

_LOG_TAIL_LINES = 40


@dataclass(frozen=True)
class NodeExit:
    """A node that ended.

    Attributes:
        name: Its name.
        code: Exit code; minus the signal's number when a signal ended it.
        log: Last lines of what it printed.
    """

    name: str
    code: int
    log: str

    @property
    def reason(self) -> str:
        """How it ended, in words."""
        if self.code < 0:
            return f"ended by {signal.Signals(-self.code).name}"
        return f"exit code {self.code}"


def _enter(core: int | None) -> None:
    """What a child does before it becomes the node: it asks to die with its parent, and takes its core."""
    # By force: without router and simulations there is nothing that a coordinator could wait for.
    _LIBC.prctl(_PR_SET_PDEATHSIG, signal.SIGKILL)
    if core is not None:
        os.sched_setaffinity(0, {core})


class LocalRuntime:
    """Runs nodes as child processes, each with a log file of its own.

    Children live in sessions of their own, so that Ctrl-C reaches the launcher alone, and are ended by the kernel when
    the launcher dies.

    Args:
        logs: Directory for the log files.
        environment: Variables added to every node's environment.
    """

    def __init__(self, logs: Path, environment: Mapping[str, str]) -> None:
        self._logs = logs
        self._environment = {**os.environ, **environment}
        self._processes: dict[str, subprocess.Popen[bytes]] = {}

    def start(self, name: str, arguments: Sequence[str], *, core: int | None = None) -> None:
        """Start a node.

        Args:
            name: Its name; names the log file too.
            arguments: Arguments of the `throwcollect` command.
            core: Processor core that it is bound to; None for any.

        Raises:
            WorkerError: If the process cannot be started or its log cannot be written.
        """
        try:
            self._logs.mkdir(parents=True, exist_ok=True)
            with (self._logs / f"{name}.log").open("ab") as log:
                self._processes[name] = subprocess.Popen(
                    [sys.executable, "-m", "throwcollect", *arguments],
                    stdin=subprocess.DEVNULL,
                    stdout=log,
                    stderr=subprocess.STDOUT,
                    env=self._environment,
                    start_new_session=True,
                    preexec_fn=partial(_enter, core),  # noqa: PLW1509 - it calls nothing that takes a lock
                )
        except OSError as error:
            raise WorkerError(f"{name}: cannot be started: {error}") from error

    def pid(self, name: str) -> int:
        """Process id of a running node.

        Raises:
            KeyError: If no such node runs.
        """
        return self._processes[name].pid

    def running(self) -> tuple[str, ...]:
        """Names of the nodes whose end has not been reported yet."""
        return tuple(self._processes)

    def exits(self) -> list[NodeExit]:
        """Nodes that ended since the last call."""
        ended = [(name, process.returncode) for name, process in self._processes.items() if process.poll() is not None]
        for name, _ in ended:
            del self._processes[name]
        return [NodeExit(name, code, self.log_tail(name)) for name, code in ended]

    def log_tail(self, name: str) -> str:
        """Last lines that a node printed."""
        try:
            with (self._logs / f"{name}.log").open(encoding="utf-8", errors="replace") as log:
                return "".join(deque(log, _LOG_TAIL_LINES)).strip()
        except OSError:
            return ""

    def said(self, name: str, line: str) -> bool:
        """Whether a node of this name has ever printed a line."""
        try:
            with (self._logs / f"{name}.log").open(encoding="utf-8", errors="replace") as log:
                return f"{line}\n" in log
        except OSError:
            return False

    def signal(self, name: str, number: signal.Signals) -> None:
        """Send a signal to a node; one that has ended is left alone."""
        if (process := self._processes.get(name)) is not None:
            process.send_signal(number)

    def stop(self, names: Sequence[str], *, grace_s: float = 3.0) -> None:
        """End nodes: politely, then after `grace_s` [s] by force."""
        for name in names:
            self.signal(name, signal.SIGTERM)
        deadline = time.monotonic() + grace_s
        for name in names:
            process = self._processes.pop(name, None)
            if process is None:
                continue
            try:
                process.wait(max(0.0, deadline - time.monotonic()))
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait()
