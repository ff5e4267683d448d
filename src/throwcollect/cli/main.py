"""The command line: all commands, each of which imports what it needs when it is called; errors become messages."""

from __future__ import annotations

import errno
import os
import signal
import sys
import traceback
from collections.abc import Callable
from dataclasses import replace
from importlib import import_module
from typing import Annotated, Any, NoReturn

import typer
from typer.exceptions import TyperException

from throwcollect.cli.streams import ensure_written
from throwcollect.errors import ConfigError, Interrupted, ThrowcollectError
from throwcollect.extras import explain_missing
from throwcollect.interruption import stop_signals
from throwcollect.version import __version__
from throwcollect.wording import printable

_WRONG_PATHS = (errno.ENAMETOOLONG, errno.ELOOP, errno.EACCES, errno.ENOTDIR, errno.ENOENT)
"""System errors that a path from the user may cause."""
_OPTIONS = {"rate_hz": "--rate"}
"""Options by the arguments that they set, where the two have different names."""

_COMMANDS = {
    "Commands": "show:init collect:up collect:resume collect:cover collect:join_run cluster_commands:submit "
    "collect:join show:config show:plan show:fit_dmp show:doctor",
    "Runs": "runs:ps runs:wait runs:logs runs:events runs:scale runs:stop runs:down serve:serve serve:view",
    "From a dataset to a throw": "learning:fit learning:aim learning:throw learning:score learning:adapt",
    "Nodes, as `up` starts them": "node_commands:router node_commands:sim node_commands:coordinator "
    "node_commands:health",
    "": "collect:begin",
}
"""Modules and functions of the commands, by panel of the help; those without a panel are hidden."""
_GROUPS = {"dataset": "dataset.commands:dataset_app", "ros": "ros.commands:ros_app", "robot": "robot_commands:app"}


def _print_version(wanted: bool) -> None:
    if wanted:
        typer.echo(f"throwcollect {__version__}")
        raise typer.Exit


def _options(
    version: Annotated[
        bool, typer.Option("--version", callback=_print_version, is_eager=True, help="Print the version.")
    ] = False,
) -> None:
    pass


def assemble(first_word: str | None = None) -> typer.Typer:
    """Assemble the whole command line, or only the command or group with a name.

    To import and to assemble all commands takes 0.1 s of processor time, a quarter of what a command takes to start.
    """
    app = typer.Typer(
        name="throwcollect",
        help="Collect databases of robot throws from many simulations at once.",
        no_args_is_help=True,
        pretty_exceptions_enable=False,
        context_settings={"help_option_names": ["-h", "--help"]},
    )
    app.callback()(_options)
    panels = {place: panel for panel, places in _COMMANDS.items() for place in places.split()}
    names = {place: typer.main.get_command_name(place.partition(":")[2]) for place in panels}
    is_known = first_word in _GROUPS or first_word in names.values()
    for place, panel in panels.items():
        if not is_known or names[place] == first_word:
            app.command(rich_help_panel=panel, hidden=not panel)(_load(place))
    for name, place in _GROUPS.items():
        if not is_known or name == first_word:
            app.add_typer(_load(place), name=name)
    return app


def _load(place: str) -> Any:
    module, _, name = place.partition(":")
    return getattr(import_module(f"throwcollect.cli.{module}"), name)


def main() -> NoReturn:
    """Run the command that the command line asks for, and exit with its code."""
    execute(typer.main.get_command(assemble(*sys.argv[1:2])))


def execute(command: Callable[..., Any]) -> NoReturn:
    """Run a command of typer, print errors as messages, exit with their codes."""
    for number in stop_signals():
        # The other signals raise KeyboardInterrupt as Ctrl-C does, so that the same code cleans up after them.
        signal.signal(number, signal.default_int_handler)
    try:
        with explain_missing():
            code = command(prog_name="throwcollect", standalone_mode=False) or 0
        # typer turns KeyboardInterrupt into this code, and prints nothing.
        if code == Interrupted.exit_code:
            raise Interrupted("interrupted")
        ensure_written(reader_may_leave=True)
    except Exception as error:  # noqa: BLE001 - the one place where the unexpected becomes a message
        if os.environ.get("THROWCOLLECT_DEBUG"):
            traceback.print_exc()
        message, code = _describe(error)
        if message:
            typer.echo(f"throwcollect: {printable(message)}", err=True)
    sys.stdout.flush()
    # While Python ends, which takes a while, a signal would only make the exit code contradict what was printed.
    for number in stop_signals():
        signal.signal(number, signal.SIG_IGN)
    sys.exit(code)


def _name_options(error: ConfigError) -> ConfigError:
    """Return the same error with the option in place of each argument, as users of commands know options alone."""
    problems = [
        replace(each, key=_OPTIONS.get(each.key, f"--{each.key}"), argument=False) if each.argument else each
        for each in error.problems
    ]
    return type(error)(problems, expected=error.expected, hint=error.hint)


def _describe(error: Exception) -> tuple[str, int]:
    """Find the message and the exit code of an error."""
    if isinstance(error, ConfigError):
        error = _name_options(error)
    if isinstance(error, ThrowcollectError):
        return str(error), error.exit_code
    if isinstance(error, TyperException):
        message = error.format_message()
        context: typer.Context | None = getattr(error, "ctx", None)
        # The message is empty if there was no argument: typer has printed the help then.
        usage = f"{context.command_path if context else 'throwcollect'} --help"
        return (f"{message}\n  try: {usage}" if message else ""), error.exit_code
    if isinstance(error, OSError) and error.strerror:
        where = "" if error.filename is None else f"{error.filename}: "
        return f"{where}{error.strerror}", ConfigError.exit_code if error.errno in _WRONG_PATHS else 1
    if isinstance(error, MemoryError):
        return "out of memory\n  try: a machine with more of it, or a higher limit (ulimit -v)", 1
    where = "  try: THROWCOLLECT_DEBUG=1 shows where; please report it"
    return f"internal error: {type(error).__name__}: {error}\n{where}", 1
