"""A process that is forked off this one and starts afresh, with the modules that are imported already."""

from __future__ import annotations

import atexit
import os
import signal
import sys
from collections.abc import Callable, Mapping
from contextlib import suppress

from throwcollect.interruption import die_with_parent


class ForkedProcess:
    """A child without a program of its own; of `subprocess.Popen`, it has what ends it.

    Args:
        work: What it does; when that comes back or raises anything, it ends.
        environment: Its environment variables.
        kept: The one file descriptor of this process that it keeps; standard streams lead nowhere.

    Raises:
        OSError: If there can be no further process.
    """

    def __init__(self, work: Callable[[], object], *, environment: Mapping[str, str], kept: int) -> None:
        for stream in (sys.stdout, sys.stderr):
            # The copy would write once more what is still waiting here.
            stream.flush()
        parent = os.getpid()
        self.pid = os.fork()
        if self.pid == 0:
            _do(work, parent, environment, kept)

    def send_signal(self, number: signal.Signals) -> None:
        """Send it a signal, unless it has ended."""
        with suppress(ProcessLookupError):
            os.kill(self.pid, number)

    def kill(self) -> None:
        """End it by force."""
        self.send_signal(signal.SIGKILL)

    def wait(self) -> int:
        """Wait for its end, once; says how it ended, as `subprocess.Popen.returncode` does."""
        return os.waitstatus_to_exitcode(os.waitpid(self.pid, 0)[1])


def _do(work: Callable[[], object], parent: int, environment: Mapping[str, str], kept: int) -> None:
    """Work, and end this process, whatever happens: what is below on the stack is the parent's."""
    code = 1
    try:
        _start_afresh(parent, environment, kept)
        work()
        code = 0
    except SystemExit as end:
        code = end.code if isinstance(end.code, int) else 1
    finally:
        # Any other exception ends here, too, and unseen: its streams lead nowhere, and the terminal is the parent's.
        os._exit(code)


def _start_afresh(parent: int, environment: Mapping[str, str], kept: int) -> None:
    """Be as a process that has just been started: let go of what is the parent's."""
    import setproctitle

    die_with_parent(parent)
    os.setsid()
    atexit._clear()
    for number in signal.valid_signals():
        if callable(signal.getsignal(number)):
            signal.signal(number, signal.SIG_DFL)
    signal.signal(signal.SIGINT, signal.default_int_handler)
    # It finds what `ps` shows only as long as the environment is the one that the program was started with.
    setproctitle.getproctitle()
    os.environ.clear()
    os.environ.update(environment)
    nowhere = os.open(os.devnull, os.O_RDWR)
    for stream in (0, 1, 2):
        os.dup2(nowhere, stream)
    for opened in map(int, os.listdir("/proc/self/fd")):
        # The directory that is read here is closed by now.
        with suppress(OSError):
            if opened > 2 and opened != kept:
                os.close(opened)
