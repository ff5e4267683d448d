"""Tells the process of a command of ours from that of another program that imports us, and how to start one more.

A command may be forked, because its threads, files and settings are known. Those of another program are not, and a fork
of it would have them, too.
"""

from __future__ import annotations

import gc
import os
import sys
import threading
from types import MappingProxyType

SERIAL_LIBRARIES = MappingProxyType({"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"})
"""Environment variables for processes that import numerical libraries.

These would start threads, which wait busily for work in the beginning. Ours has none for them: one process per core
fills the machine, and what ends up in files is computed without BLAS.
"""

_commands: list[bool] = []


def claim_process() -> None:
    """Declare that this process runs a command and nothing else, before it imports numerical libraries."""
    _commands.append(True)
    for name, value in SERIAL_LIBRARIES.items():
        os.environ.setdefault(name, value)


def may_be_forked() -> bool:
    """Whether this process runs a command, and has no other thread whose locks a fork would copy."""
    return bool(_commands) and threading.active_count() == 1


def keep_objects() -> None:
    """Have the garbage collector pass over all present objects until the end of this process, if it runs a command.

    Nearly all of them belong to modules, and the end of the interpreter would look through them once more, for a tenth
    of a second. What comes later is still looked through: sessions of Zenoh leave files behind where it is not.
    """
    if _commands:
        gc.freeze()


def make_command(module: str = "throwcollect") -> list[str]:
    """Make the beginning of a command line that runs a module of ours by this Python.

    With ``-m`` alone, Python would look for all modules in the working directory first, also for those of its own
    library: a file of the user's, or one that comes with somebody's dataset, would be run in place of them.
    """
    if sys.version_info >= (3, 11):
        return [sys.executable, "-P", "-m", module]
    run = f"import runpy; runpy.run_module({module!r}, run_name='__main__', alter_sys=True)"
    return [sys.executable, "-c", f"import sys; del sys.path[0]; {run}"]
