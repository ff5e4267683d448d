"""Options and arguments that several commands of `throwcollect ros` have."""

from __future__ import annotations

from typing import Annotated

import typer


def _settle_middleware(run: str | None) -> str | None:
    """Make this process use the middleware of the run; without a run, the environment decides.

    This has to happen before the process takes any name from `throwcollect.ros`.
    """
    if run is not None:
        from throwcollect.cli.ros.joined_run import find_run_and_connection

        find_run_and_connection(run)[1].middleware.settle()
    return run


RunOption = Annotated[
    str | None,
    typer.Option(
        "--run",
        metavar="RUN",
        callback=_settle_middleware,
        help="Join this run: its id, the beginning of that, or the dataset's directory. By default, the router that "
        "ZENOH_CONFIG_OVERRIDE names, or the one at tcp/localhost:7447.",
    ),
]
TypesOption = Annotated[bool, typer.Option("-t", "--show-types", help="Show the types, too.")]
HiddenOption = Annotated[bool, typer.Option("-a", "--all", help="Show what is hidden, too: names that begin with '_'.")]
TopicArgument = Annotated[str, typer.Argument(metavar="TOPIC", help="Name of the topic.")]
NodeArgument = Annotated[str, typer.Argument(metavar="NODE", help="Name of the node, with its namespace.")]
ParameterArgument = Annotated[str, typer.Argument(metavar="NAME", help="Name of the parameter.")]
