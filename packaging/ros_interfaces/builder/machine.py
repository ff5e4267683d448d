"""Whether this machine can build the wheel, before anything is downloaded for it."""

from __future__ import annotations

import os
import platform
import shlex
import shutil
import sys
import sysconfig
from pathlib import Path

_LEAST_GLIBC = (2, 28)
_WITHOUT = "throwcollect works without it, on the embedded backend"


def check() -> None:
    """Look for everything that pip cannot bring.

    Raises:
        SystemExit: If something is missing or wrong; with one sentence that says what to do.
    """
    where = f"{platform.system()} {platform.machine()}"
    if where != "Linux x86_64":
        sys.exit(f"the wheels of ROS 2 are for Linux on x86-64 alone, and this is {where}; {_WITHOUT}.")
    if sys.implementation.name != "cpython" or sys.version_info[:2] != (3, 11):
        found = f"{platform.python_implementation()} {platform.python_version()}"
        sys.exit(
            f"genuine ROS 2 by pip is for CPython 3.11 alone, and this is {found}: make the virtual environment with "
            f"python3.11; {_WITHOUT}."
        )
    library, version = platform.libc_ver()
    if library != "glibc" or tuple(map(int, version.split(".")[:2])) < _LEAST_GLIBC:
        found = f"{library} {version}" if library else "another C library"
        sys.exit(f"the wheels of ROS 2 need glibc 2.28 or later, and this machine has {found}; {_WITHOUT}.")
    compilers()
    headers = sysconfig.get_path("include")
    if not (Path(headers) / "Python.h").is_file():
        sys.exit(
            f"interfaces are compiled for this Python, and its headers are missing ({headers}/Python.h): install them "
            "(Debian and Ubuntu: apt install python3-dev)."
        )


def compilers() -> tuple[list[str], list[str]]:
    """The commands that compile C and C++: those that ``CC`` and ``CXX`` name, else what is there.

    Raises:
        SystemExit: If there is none, or the one that is named is not there.
    """
    return _command("CC", ("gcc", "clang", "cc"), "C"), _command("CXX", ("g++", "clang++", "c++"), "C++")


def _command(variable: str, names: tuple[str, ...], language: str) -> list[str]:
    if named := shlex.split(os.environ.get(variable, "")):
        if shutil.which(named[0]) is None:
            sys.exit(f"{variable} names {named[0]}, which is not there: name a {language} compiler, or unset it.")
        return named
    for name in names:
        if shutil.which(name):
            return [name]
    return sys.exit(
        f"interfaces are compiled here, and there is no {language} compiler: install g++ (Debian and Ubuntu: apt "
        f"install g++; Fedora: dnf install gcc-c++), or name one by {variable}."
    )
