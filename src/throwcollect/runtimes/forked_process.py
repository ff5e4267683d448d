"""A process that is forked off this one and starts like a new one, but has the modules that this one has imported."""

from __future__ import annotations

import atexit
import os
import signal
import sys
from collections.abc import Callable, Mapping
from contextlib import suppress

from throwcollect.interruption import die_with_parent


class ForkedProcess:
    """A forked process, with the methods of `subprocess.Popen` that end it.

    Args:
        work: Function that the process calls; the process ends when it returns or raises.
        environment: Environment variables of the process.
        kept: The only file descriptor that stays open in the process; its standard streams lead to ``/dev/null``.

    Raises:
        OSError: If the process cannot be started.
    """

    def __init__(self, work: Callable[[], object], *, environment: Mapping[str, str], kept: int) -> None:
        for stream in (sys.stdout, sys.stderr):
            # Otherwise the forked process would write the content of the stream's buffer a second time.
            stream.flush()
        parent = os.getpid()
        self.pid = os.fork()
        if self.pid == 0:
            _work_and_exit(work, parent, environment, kept)

    def send_signal(self, number: signal.Signals) -> None:
        """Send the process a signal, unless it has ended."""
        with suppress(ProcessLookupError):
            os.kill(self.pid, number)

    def kill(self) -> None:
        """End the process by force."""
        self.send_signal(signal.SIGKILL)

    def wait(self) -> int:
        """Wait for the end of the process, and return a code like `subprocess.Popen.returncode`; may be called once."""
        return os.waitstatus_to_exitcode(os.waitpid(self.pid, 0)[1])


def _work_and_exit(work: Callable[[], object], parent: int, environment: Mapping[str, str], kept: int) -> None:
    """Call `work`, then always end this process, because the functions that called this one belong to the parent."""
    code = 1
    try:
        _start_afresh(parent, environment, kept)
        work()
        code = 0
    except SystemExit as end:
        code = end.code if isinstance(end.code, int) else 1
    finally:
        # Any other exception ends here, too. Nobody sees it, because the terminal belongs to the parent.
        os._exit(code)


def _start_afresh(parent: int, environment: Mapping[str, str], kept: int) -> None:
    """Release everything that belongs to the parent, as if this process had just been started."""
    import setproctitle

    die_with_parent(parent)
    os.setsid()
    # The registered functions are the parent's. Nodes that are forked off this process would run them at their end.
    atexit._clear()
    # As after `exec`, handlers are removed, and signals that were ignored are still ignored.
    for number in signal.valid_signals():
        if callable(signal.getsignal(number)):
            signal.signal(number, signal.SIG_DFL)
    signal.signal(signal.SIGINT, signal.default_int_handler)
    # setproctitle looks for the title's memory at its first call, and only finds it while the environment is unchanged.
    setproctitle.getproctitle()
    os.environ.clear()
    os.environ.update(environment)
    # Nothing may reach the terminal, and files, locks and sockets of the parent must not stay open here.
    nowhere = os.open(os.devnull, os.O_RDWR)
    for stream in (0, 1, 2):
        os.dup2(nowhere, stream)
    for opened in map(int, os.listdir("/proc/self/fd")):
        # Listing the directory opened one of these descriptors, which is closed by now.
        with suppress(OSError):
            if opened > 2 and opened != kept:
                os.close(opened)
