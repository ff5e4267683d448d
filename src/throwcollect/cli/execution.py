"""Runs a command from its command line to its exit code, and turns every error into a message."""

from __future__ import annotations

import errno
import os
import re
import signal
import sys
import time
import traceback
from collections.abc import Callable
from contextlib import suppress
from dataclasses import replace
from typing import Any, NoReturn

import typer
from typer.exceptions import TyperException

from throwcollect.cli.streams import ReaderGone, ensure_written
from throwcollect.errors import ConfigError, Interrupted, ThrowcollectError, WorkerError
from throwcollect.extras import explain_missing
from throwcollect.interruption import stop_signals
from throwcollect.wording import is_text, printable

_WRONG_PATHS = (errno.ENAMETOOLONG, errno.ELOOP, errno.EACCES, errno.ENOTDIR)
"""System errors that a path from the user may cause, and that are no errors of this program."""
_CLOCK_END_S = 2**31
"""Time since 1970 [s], in January 2038, that messages of ROS 2 cannot hold any more; Zenoh holds none before 1970."""
_NO_ROOM = "failed to map segment from shared object"
"""End of the message of an `ImportError` if a library does not fit into the memory."""
_NO_TEMPORARY_DIRECTORY = "No usable temporary directory found"
"""Beginning of the message of Python's `tempfile`."""
_PROCESSES_OF_RUNS = ("launch", "begin", "router", "sim", "coordinator")
"""Commands that a run starts."""
_STRAY_NUMBER = re.compile(r"(option: -|\(-?)[.\d][\d. -]*\)?$")
"""End of typer's messages on a number that belongs to no option or argument."""
_OPTIONS = {"rate_hz": "--rate"}
"""Options by the arguments that they set, where the two have different names."""


def execute(command: Callable[..., Any]) -> NoReturn:
    """Run a command of typer, print errors as messages, exit with their codes."""
    for number in stop_signals():
        # The other signals raise KeyboardInterrupt as Ctrl-C does, so that the same code cleans up after them.
        signal.signal(number, signal.default_int_handler)
    try:
        _check_surroundings()
        with explain_missing():
            code = command(prog_name="throwcollect", standalone_mode=False) or 0
        # typer turns KeyboardInterrupt into this code, and prints nothing.
        if code == Interrupted.exit_code:
            raise Interrupted("interrupted")
        ensure_written(reader_may_leave=True)
    except ReaderGone:
        code = 0
    except Exception as error:  # noqa: BLE001 - the one place where the unexpected becomes a message
        if os.environ.get("THROWCOLLECT_DEBUG"):
            traceback.print_exc()
        message, code = _describe(error)
        if message:
            typer.echo(f"throwcollect: {printable(message)}", err=True)
    with suppress(ReaderGone):
        sys.stdout.flush()
    # The result is told. While Python ends, which takes a while, a signal would only make the exit code contradict it.
    for number in stop_signals():
        signal.signal(number, signal.SIG_IGN)
    sys.exit(code)


def _check_surroundings() -> None:
    """Refuse a clock that records cannot hold, and a command line and a directory that names of files cannot hold.

    Processes of a run need no current directory, because they are given absolute paths. That of their user may be gone.
    """
    try:
        is_dated = 0 <= time.time() < _CLOCK_END_S
    except OverflowError:
        is_dated = False
    if not is_dated:
        raise ConfigError("the clock of this machine shows a year before 1970 or after 2037", hint="set it")
    try:
        here = os.getcwd()
    except OSError as error:
        if sys.argv[1:2] and sys.argv[1] in _PROCESSES_OF_RUNS:
            return
        raise ConfigError(
            f"the current directory cannot be used: {error.strerror}", hint="go to another one"
        ) from error
    for word in (*sys.argv[1:], here):
        if not is_text(word):
            raise ConfigError(f"{word}: should be UTF-8 text")


def _name_options(error: ConfigError) -> ConfigError:
    """Return the same error with the option in place of each argument, as users of commands know options alone."""
    if not any(problem.argument for problem in error.problems):
        return error
    problems = [
        replace(each, key=_OPTIONS.get(each.key, f"--{each.key}"), argument=False) if each.argument else each
        for each in error.problems
    ]
    return type(error)(problems, expected=error.expected, hint=error.hint)


def _name_run(context: typer.Context) -> str:
    """Write how to name the run of a command that takes no arguments, as users may have given it without an option."""
    has_run = any(each.name == "run" for each in context.command.params)
    has_arguments = any(each.param_type_name == "argument" for each in context.command.params)
    return f"{context.command_path} --run RUN, or " if has_run and not has_arguments else ""


def _explain_commas(context: typer.Context, message: str) -> str:
    """Write a line on commas for a number that stands alone, if the command has an option that takes several."""
    option = next((each for each in context.command.params if getattr(each, "metavar", None) == "X,Y"), None)
    if option is None or not _STRAY_NUMBER.search(message):
        return ""
    return f"  expected: commas between the numbers, such as {option.opts[0]} 1.4,-0.2\n"


def _describe(error: Exception) -> tuple[str, int]:
    """Find the message and the exit code of an error."""
    if isinstance(error.__cause__, KeyboardInterrupt):
        # Python wraps what is raised in some functions of classes, such as `__set_name__`.
        error = Interrupted("interrupted")
    if isinstance(error, ConfigError):
        error = _name_options(error)
    if isinstance(error, ThrowcollectError):
        return str(error), error.exit_code
    if isinstance(error, TyperException):
        message = error.format_message()
        context: typer.Context | None = getattr(error, "ctx", None)
        usage = f"{_name_run(context)}{context.command_path} --help" if context else "throwcollect --help"
        expected = _explain_commas(context, message) if context else ""
        # The message is empty if there was no argument: typer has printed the help then.
        return (f"{message}\n{expected}  try: {usage}" if message else ""), error.exit_code
    if isinstance(error, OSError) and error.errno in _WRONG_PATHS and error.filename is not None:
        return f"{error.filename}: {error.strerror}", ConfigError.exit_code
    if isinstance(error, FileNotFoundError) and error.filename is None:
        try:
            # The current directory may have been removed while the command ran.
            _check_surroundings()
        except ConfigError as reason:
            return str(reason), reason.exit_code
    if isinstance(error, OSError) and (error.strerror or "").startswith(_NO_TEMPORARY_DIRECTORY):
        return "no directory for temporary files can be written\n  try: name one in TMPDIR", ConfigError.exit_code
    number = error.errno if isinstance(error, OSError) else None
    if number == errno.EMFILE:
        return "too many open files\n  try: a higher limit (ulimit -n)", WorkerError.exit_code
    if isinstance(error, MemoryError) or number == errno.ENOMEM or str(error).endswith(_NO_ROOM):
        return "out of memory\n  try: a machine with more of it, or a higher limit (ulimit -v)", WorkerError.exit_code
    where = "  try: THROWCOLLECT_DEBUG=1 shows where; please report it"
    return f"internal error: {type(error).__name__}: {error}\n{where}", 1
