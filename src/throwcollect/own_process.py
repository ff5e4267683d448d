"""How a process of ours begins another one, shows that it runs, and ends: environment, heartbeat and signals.

Signs of life need no ROS: a line in the log of a node when it is ready, and a file that its loop touches. The health
check of its container looks at the time of the file, which costs nearly nothing; a file that is older than 5 s means
that the node is stuck. To ask the node itself, a process would have to join the graph, every few seconds in every
container. The image names the file; outside of containers there is none.
"""

from __future__ import annotations

import ctypes
import os
import signal
import sys
import threading
import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from types import FrameType, MappingProxyType
from typing import NoReturn

SERIAL_LIBRARIES = MappingProxyType({"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"})
"""Environment variables for processes that import numerical libraries.

These libraries would start threads, which at first wait busily for work. We have no work for them: one process per core
fills the machine, and everything that ends up in files is computed without BLAS.
"""


def prepare_environment() -> None:
    """Prepare the environment of this process, which runs a command, and of all that it starts, before their imports.

    Numerical libraries start no threads, and Python looks for no modules in the working directory: it would run files
    there, perhaps those of a downloaded dataset, in place of modules of its own library.
    """
    for name, value in {**SERIAL_LIBRARIES, "PYTHONSAFEPATH": "1"}.items():
        os.environ.setdefault(name, value)


def make_command() -> list[str]:
    """Make the beginning of a command line that runs `throwcollect` by this Python.

    With ``-m`` alone, Python would look for all modules in the working directory first, even for modules of its own
    library: a file of the user, or a file in a downloaded dataset, would be run in their place.
    """
    if sys.version_info >= (3, 11):
        return [sys.executable, "-P", "-m", "throwcollect"]
    run = "import runpy; runpy.run_module('throwcollect', run_name='__main__', alter_sys=True)"
    return [sys.executable, "-c", f"import sys; del sys.path[0]; {run}"]


_PR_SET_PDEATHSIG = 1
"""prctl(2): the signal that a process gets when its parent dies."""
# The C library that this process has loaded already; Python itself has no `prctl`.
_LIBC = ctypes.CDLL(None)


def stop_signals() -> tuple[signal.Signals, ...]:
    """List the signals that ask this process to end: SIGINT, SIGTERM, and SIGHUP, which a closed terminal sends.

    Those that this process ignores are left out. `nohup` arranges that for SIGHUP, and shells arrange it for SIGINT if
    a script starts a command with `&`.
    """
    asking = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
    return tuple(number for number in asking if signal.getsignal(number) is not signal.SIG_IGN)


def leave_when_stopped() -> None:
    """Let signals end this process at once, because it has not yet begun anything that has to be ended in order.

    A handler that raises an exception would not do, because a library that is being imported may ignore it.
    """
    for number in stop_signals():
        signal.signal(number, _leave)


def _leave(_number: int, _frame: FrameType | None) -> NoReturn:
    os._exit(130)


@contextmanager
def count_interruptions(numbers: Iterable[signal.Signals] | None = None) -> Iterator[Callable[[], int]]:
    """Count signals instead of letting them raise or end this process, so that the block can end its nodes in order.

    In other threads than the main one none are counted, because signals never reach them.

    Args:
        numbers: The signals; None counts all that ask to stop, such as Ctrl-C.

    Yields:
        Returns the number of signals so far.
    """
    if threading.current_thread() is not threading.main_thread():
        yield lambda: 0
        return
    count = 0

    def note(_number: int, _frame: FrameType | None) -> None:
        nonlocal count
        count += 1

    counted = stop_signals() if numbers is None else numbers
    previous = {number: signal.signal(number, note) for number in counted}
    try:
        yield lambda: count
    finally:
        for number, handler in previous.items():
            signal.signal(number, handler)


def die_with_parent(parent: int) -> None:
    """Ask the kernel to kill this process when its parent dies; a child has to call it right after the fork.

    `parent` is the process id of the parent. If the parent has died before the call, the kernel will send no signal, so
    this process ends at once.
    """
    _LIBC.prctl(_PR_SET_PDEATHSIG, signal.SIGKILL)
    if os.getppid() != parent:
        os._exit(1)


HEARTBEAT_VARIABLE = "THROWCOLLECT_HEARTBEAT"
"""Name of the environment variable that names the file."""
_PERIOD_S = 1.0


def ready_line(name: str) -> str:
    """Write the line in the log of a simulation by which its node announces that it is ready for trials."""
    return f"{name} is ready"


class Heartbeat:
    """Touches the file that the environment names, if it names one."""

    def __init__(self) -> None:
        named = os.environ.get(HEARTBEAT_VARIABLE)
        self._path = Path(named) if named else None
        self._due = 0.0

    def beat(self) -> None:
        """Touch the file, at most once a second, so that the loop may call this each time."""
        # Unlike the time of day, this clock cannot be set back; after that, no beat would be due for a long time.
        now = time.monotonic()
        if self._path is not None and now >= self._due:
            self._due = now + _PERIOD_S
            self._path.touch()
