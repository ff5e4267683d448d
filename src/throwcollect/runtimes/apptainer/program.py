"""Runs the program Apptainer or Singularity of this machine."""

from __future__ import annotations

import os
import shutil
import signal
import subprocess
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path
from types import MappingProxyType

from throwcollect.errors import WorkerError

_PROGRAMS = ("apptainer", "singularity")
_FATAL = "FATAL:"
_EVIDENCE_LINES = 15
_NO_PLACES: Mapping[str, Path] = MappingProxyType({})
_PATIENCE_S = 10.0
"""Time that Apptainer and the programs that it has started have to end after SIGTERM."""


def find_program() -> str:
    """Find the path of Apptainer, or else of Singularity."""
    found = next(filter(None, map(shutil.which, _PROGRAMS)), None)
    if found is None:
        raise WorkerError(
            "neither apptainer nor singularity is installed here",
            hint="clusters often have it as a module: module load apptainer",
        )
    return found


def call(what: str, *arguments: str, cwd: Path | None = None, places: Mapping[str, Path] = _NO_PLACES) -> str:
    """Run Apptainer, and return its output; if it fails, the message of the error begins with `what`.

    `places` has directories for Apptainer, by the end of the name of the environment variable that Apptainer reads,
    such as ``TMPDIR``; a variable that the user has set is left as it is.
    """
    program = find_program()
    prefix = Path(program).name.upper()
    named = {f"{prefix}_{name}": str(path) for name, path in places.items()}
    # Apptainer starts other programs. In a session of their own, `_end` can end all of them.
    process = subprocess.Popen(
        [program, "--nocolor", *arguments],
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        errors="replace",
        cwd=cwd,
        env={**named, **os.environ},
        start_new_session=True,
    )
    try:
        printed, said = process.communicate()
    except BaseException:
        # Ctrl-C in the terminal does not reach programs in another session.
        _end(process)
        raise
    if process.returncode:
        lines = [line.rstrip() for line in (printed + said).splitlines() if line.strip()]
        reason = next((line.removeprefix(_FATAL).strip() for line in lines if line.startswith(_FATAL)), None)
        raise WorkerError(
            f"{what}: {reason or f'exit code {process.returncode} of {Path(program).name}'}",
            evidence="\n".join(lines[-_EVIDENCE_LINES:]) or None,
        )
    return printed


def _end(process: subprocess.Popen[str]) -> None:
    for number in (signal.SIGTERM, signal.SIGKILL):
        with suppress(ProcessLookupError):
            os.killpg(process.pid, number)
        with suppress(subprocess.TimeoutExpired):
            process.wait(_PATIENCE_S)
            return
