"""Says whether this process runs a command of ours or another program that imports us, and how to start a command.

The process of a command may be forked, because its threads, files and settings are known. Threads, files and settings
of another program are unknown, and a fork would inherit them.
"""

from __future__ import annotations

import gc
import os
import sys
import threading
from types import MappingProxyType

SERIAL_LIBRARIES = MappingProxyType({"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"})
"""Environment variables for processes that import numerical libraries.

These libraries would start threads, which at first wait busily for work. We have no work for them: one process per core
fills the machine, and everything that ends up in files is computed without BLAS.
"""

_commands: list[bool] = []


def claim_process() -> None:
    """Declare that this process runs a command and nothing else, before it imports numerical libraries."""
    _commands.append(True)
    for name, value in SERIAL_LIBRARIES.items():
        os.environ.setdefault(name, value)


def may_be_forked() -> bool:
    """Say whether this process runs a command, and has no other thread whose locks a fork would copy."""
    return bool(_commands) and threading.active_count() == 1


def keep_objects() -> None:
    """If this process runs a command, let the garbage collector ignore all present objects until the process ends.

    Nearly all of them belong to modules, and at its end the interpreter would look through them once more, for a tenth
    of a second. Later objects are still looked through, because otherwise sessions of Zenoh would leave files behind.
    """
    if _commands:
        gc.freeze()


def make_command(module: str = "throwcollect") -> list[str]:
    """Make the beginning of a command line that runs a module of ours by this Python.

    With ``-m`` alone, Python would look for all modules in the working directory first, even for modules of its own
    library: a file of the user, or a file in somebody's dataset, would be run in their place.
    """
    if sys.version_info >= (3, 11):
        return [sys.executable, "-P", "-m", module]
    run = f"import runpy; runpy.run_module({module!r}, run_name='__main__', alter_sys=True)"
    return [sys.executable, "-c", f"import sys; del sys.path[0]; {run}"]
