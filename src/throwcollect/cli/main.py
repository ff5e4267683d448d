"""The command line: all commands, each of which imports what it needs when it is called; errors become messages."""

from __future__ import annotations

import errno
import gc
import os
import signal
import sys
import traceback
from collections.abc import Callable
from importlib import import_module
from typing import Annotated, Any, NoReturn

import typer
from typer.exceptions import TyperException

from throwcollect.cli.options import describe
from throwcollect.cli.streams import ensure_written
from throwcollect.errors import ConfigError, Interrupted, ThrowcollectError
from throwcollect.extras import explain_missing
from throwcollect.own_process import stop_signals
from throwcollect.version import __version__
from throwcollect.wording import printable

_WRONG_PATHS = (errno.ENAMETOOLONG, errno.ELOOP, errno.EACCES, errno.ENOTDIR, errno.ENOENT)
"""System errors that a path from the user may cause."""

_COMMANDS = {
    "Commands": "show:init collect:up collect:resume collect:cover collect:join_run cluster_commands:submit "
    "collect:join show:config show:plan show:fit_dmp show:doctor",
    "Runs": "runs:ps runs:wait runs:logs runs:events runs:scale runs:stop runs:down serve:serve serve:view",
    "From a dataset to a throw": "learning:fit learning:aim learning:throw learning:score learning:adapt",
    "Nodes, as `up` starts them": "node_commands:router node_commands:sim node_commands:sensors "
    "node_commands:coordinator",
    "": "collect:begin",
}
"""Modules and functions of the commands, by panel of the help; those without a panel are hidden."""
_GROUPS = {
    "dataset": (
        "Look into datasets, and make others from them.",
        "dataset.info:info dataset.info:verify dataset.writing:export dataset.derive:merge "
        "dataset.derive:filter_ dataset.derive:sample dataset.derive:split dataset.derive:render_sensors "
        "dataset.derive:stats dataset.writing:report dataset.writing:view dataset.writing:render dataset.info:replay",
    ),
    "robot": (
        "Import, check and list robots.",
        "robot_commands:import_ robot_commands:check robot_commands:list_",
    ),
}
"""Help and commands of each group."""


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


def assemble(*words: str) -> typer.Typer:
    """Assemble the command line: the command that the first words name, or all commands if they name none.

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
    first, second = (*words, "", "")[:2]
    is_known = first in (*_GROUPS, "ros") or any(
        first == _name(place) for place in " ".join(_COMMANDS.values()).split()
    )
    for panel, places in _COMMANDS.items():
        _add(app, places, first, is_known=is_known, rich_help_panel=panel, hidden=not panel)
    for name, (text, places) in _GROUPS.items():
        if not is_known or name == first:
            group = typer.Typer(help=text, no_args_is_help=True)
            _add(group, places, second, is_known=any(second == _name(place) for place in places.split()))
            app.add_typer(group, name=name)
    if not is_known or first == "ros":
        app.add_typer(import_module("throwcollect.cli.ros.commands").ros_app, name="ros")
    return app


def _name(place: str) -> str:
    return place.partition(":")[2].strip("_").replace("_", "-")


def _add(app: typer.Typer, places: str, word: str, *, is_known: bool, **facts: Any) -> None:
    """Add the command of a name to a group; all commands if it has none of that name."""
    for place in places.split():
        if not is_known or _name(place) == word:
            module, _, name = place.partition(":")
            function = getattr(import_module(f"throwcollect.cli.{module}"), name)
            app.command(_name(place), help=describe(function), **facts)(function)


def main() -> NoReturn:
    """Run the command that the command line asks for, and exit with its code."""
    execute(typer.main.get_command(assemble(*sys.argv[1:3])))


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
    # As it ends, Python looks for garbage among all objects, which takes a sixth of the time of a short command.
    gc.freeze()
    # While Python ends, which takes a while, a signal would only make the exit code contradict what was printed.
    for number in stop_signals():
        signal.signal(number, signal.SIG_IGN)
    sys.exit(code)


def _describe(error: Exception) -> tuple[str, int]:
    """Find the message and the exit code of an error."""
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
