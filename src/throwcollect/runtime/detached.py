"""A launcher as a process of its own, which the terminal that started it does not take along."""

from __future__ import annotations

import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

from throwcollect.errors import Interrupted, WorkerError
from throwcollect.files import open_log
from throwcollect.runtime.node_logs import NodeLogs
from throwcollect.runtime.nodes import LAUNCHER
from throwcollect.runtime.records import OpenRun, Record, Records
from throwcollect.runtime.runs import failure

_POLL_S = 0.05


def start_launcher(run: OpenRun) -> subprocess.Popen[bytes]:
    """Hand a prepared run over to a new process.

    Args:
        run: The run, with a record; this process lets go of it.

    Returns:
        The process.

    Raises:
        WorkerError: If it cannot be started.
    """
    path = NodeLogs(Path(run.record.logs)).path(LAUNCHER)
    command = [sys.executable, "-m", "throwcollect", "launch", run.run, "--lock", str(run.lock)]
    try:
        with open(open_log(path), "ab") as log:
            return subprocess.Popen(
                command,
                stdin=subprocess.DEVNULL,
                stdout=log,
                stderr=subprocess.STDOUT,
                start_new_session=True,
                # It holds the lock from its first moment, so that nobody ever takes the run for dead.
                pass_fds=[run.lock],
            )
    except OSError as error:
        raise WorkerError(f"the launcher cannot be started: {error}") from error
    finally:
        run.close()


def wait_for_nodes(
    records: Records, record: Record, process: subprocess.Popen[bytes], *, interruptions: Callable[[], int]
) -> None:
    """Wait until a new launcher has started its nodes.

    Args:
        records: All runs.
        record: The run, as it was handed over.
        process: The launcher.
        interruptions: How often the user has asked to stop; the launcher is told then, and waited for.

    Raises:
        ConfigError: If the record cannot be read.
        ThrowcollectError: What the run ended with, if it did.
        WorkerError: If the launcher ended without saying why.
        Interrupted: If the user stopped it.
    """
    told = 0
    while (run := records.get(record.run)).status == "running":
        if interruptions() > told:
            told = interruptions()
            process.terminate()
        nodes = run.record.nodes
        if nodes and all(node.handle for node in nodes) and not told:
            return
        time.sleep(_POLL_S)
    if run.record.ended is not None:
        if (error := failure(run.record)) is not None:
            raise error
    elif told:
        raise Interrupted("interrupted before any node was started")
    else:
        evidence = NodeLogs(Path(record.logs)).tail(LAUNCHER)
        raise WorkerError(f"run {record.run}: its launcher died", evidence=evidence or None)
