"""How a process of ours limits the threads of libraries, and how it starts another command of ours."""

from __future__ import annotations

import os
import sys
from types import MappingProxyType

SERIAL_LIBRARIES = MappingProxyType({"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"})
"""Environment variables for processes that import numerical libraries.

These libraries would start threads, which at first wait busily for work. We have no work for them: one process per core
fills the machine, and everything that ends up in files is computed without BLAS.
"""


def prepare_environment() -> None:
    """Prepare the environment of this process, which runs a command, and of all that it starts, before their imports.

    Numerical libraries start no threads, and Python looks for no modules in the working directory: it would run files
    there, perhaps of somebody's dataset, in place of modules of its own library.
    """
    for name, value in {**SERIAL_LIBRARIES, "PYTHONSAFEPATH": "1"}.items():
        os.environ.setdefault(name, value)


def make_command() -> list[str]:
    """Make the beginning of a command line that runs `throwcollect` by this Python.

    With ``-m`` alone, Python would look for all modules in the working directory first, even for modules of its own
    library: a file of the user, or a file in somebody's dataset, would be run in their place.
    """
    if sys.version_info >= (3, 11):
        return [sys.executable, "-P", "-m", "throwcollect"]
    run = "import runpy; runpy.run_module('throwcollect', run_name='__main__', alter_sys=True)"
    return [sys.executable, "-c", f"import sys; del sys.path[0]; {run}"]
