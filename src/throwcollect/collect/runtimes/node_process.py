"""Nodes as processes of this machine, which are forked from one that has imported what nodes need.

Importing takes a second of a processor: without this, eight nodes on two cores would spend four seconds with it.
"""

from __future__ import annotations

import multiprocessing
import os
import runpy
import signal
import sys
from collections.abc import Mapping, Sequence
from multiprocessing import forkserver
from multiprocessing.process import BaseProcess
from pathlib import Path

import setproctitle

from throwcollect.files import open_log
from throwcollect.interruption import die_with_parent
from throwcollect.own_process import make_command
from throwcollect.ros.middleware import VARIABLE
from throwcollect.side_by_side import launching

FORESEEN = "THROWCOLLECT_FORESEEN"
"""Environment variable by which `fork_server` gets the configuration of simulations, in JSON."""


def begin_imports(*modules: str, foreseen: str = "") -> None:
    """Let a process begin to import what nodes need, and `modules`, unless it has begun; it ends with this process.

    What simulations of the configuration `foreseen`, in JSON, begin with is worked out there, once for all of them.
    """
    forkserver.set_forkserver_preload(["throwcollect.collect.runtimes.fork_server", *modules])
    with launching():
        # The kernel starts no process with an environment variable of 128 KiB.
        os.environ[FORESEEN] = foreseen[:100_000]
        forkserver.ensure_running()
        del os.environ[FORESEEN]


def start_process(
    command: Sequence[str], environment: Mapping[str, str], log: Path, *, core: int | None
) -> BaseProcess:
    """Start a node in a session of its own, which Ctrl-C does not reach; the kernel ends it with this process.

    Args:
        command: The command line of the node.
        environment: All environment variables of the node.
        log: File to which its output is appended.
        core: Processor core to which it is bound; None for any.
    """
    begin_imports()
    run = (tuple(command), dict(environment), log.absolute(), Path.cwd(), core)
    process = multiprocessing.get_context("forkserver").Process(target=_run, args=run)
    with launching():
        process.start()
    return process


def _run(command: Sequence[str], environment: Mapping[str, str], log: Path, cwd: Path, core: int | None) -> None:
    """Become a node, as if this process had been started by its command line."""
    # Otherwise this process would keep the server alive, and the server, on whose end it waits, this process.
    os.close(forkserver._forkserver._forkserver_alive_fd)  # type: ignore[attr-defined]
    die_with_parent(os.getppid())
    launcher = multiprocessing.parent_process()
    if launcher is None or not launcher.is_alive():
        os._exit(1)
    os.setsid()
    output = open_log(log)
    for stream in (1, 2):
        os.dup2(output, stream)
    os.close(output)
    signal.pthread_sigmask(signal.SIG_SETMASK, ())
    if core is not None:
        os.sched_setaffinity(0, {core})
    os.chdir(cwd)
    ours = make_command()
    if command[: len(ours)] != tuple(ours) or environment[VARIABLE] != "embedded":
        # The server has imported our libraries with the embedded backend, and a process has one.
        os.execve(command[0], list(command), environment)  # noqa: S606 - no shell is wanted
    # This works only before the environment is replaced.
    setproctitle.setproctitle(" ".join(command))
    os.environ.clear()
    os.environ.update(environment)
    sys.argv[1:] = command[len(ours) :]
    runpy.run_module("throwcollect", run_name="__main__", alter_sys=True)
