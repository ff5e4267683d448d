"""`throwcollect ros`: a look into the ROS graph with the commands of ROS 2, where there is no ROS 2."""

from __future__ import annotations

from typing import Annotated

import typer

from throwcollect.cli.streams import end_with_reader

ros_app = typer.Typer(help="Look into the ROS graph, as the command `ros2` does.", no_args_is_help=True)
topic_app = typer.Typer(help="Topics: list, echo, hz, info.", no_args_is_help=True)
node_app = typer.Typer(help="Nodes: list, info.", no_args_is_help=True)
service_app = typer.Typer(help="Services: list, call.", no_args_is_help=True)
action_app = typer.Typer(help="Actions: list, send.", no_args_is_help=True)
param_app = typer.Typer(help="Parameters: list, get, set.", no_args_is_help=True)
ros_app.add_typer(topic_app, name="topic")
ros_app.add_typer(node_app, name="node")
ros_app.add_typer(service_app, name="service")
ros_app.add_typer(action_app, name="action")
ros_app.add_typer(param_app, name="param")


def _settle(run: str | None) -> str | None:
    from throwcollect.cli.ros.env import settle

    return settle(run)


RunOption = Annotated[
    str | None,
    typer.Option(
        "--run",
        metavar="RUN",
        callback=_settle,
        help="Join this run: its id, the beginning of that, or the dataset's directory. By default, the router that "
        "ZENOH_CONFIG_OVERRIDE names, or the one at tcp/localhost:7447.",
    ),
]
TypesOption = Annotated[bool, typer.Option("-t", "--show-types", help="Show the types, too.")]
HiddenOption = Annotated[bool, typer.Option("-a", "--all", help="Show what is hidden, too: names that begin with '_'.")]
TopicArgument = Annotated[str, typer.Argument(metavar="TOPIC", help="Name of the topic.")]
NodeArgument = Annotated[str, typer.Argument(metavar="NODE", help="Name of the node, with its namespace.")]
ParameterArgument = Annotated[str, typer.Argument(metavar="NAME", help="Name of the parameter.")]


@ros_app.command("env")
def env(
    run: Annotated[
        str | None,
        typer.Option(
            "--run",
            metavar="RUN",
            help="Id of a run, its beginning, or the dataset's directory; by default, the only one.",
        ),
    ] = None,
) -> None:
    """Print the line that lets a shell's ROS 2 nodes join a run: eval "$(throwcollect ros env)"."""
    from throwcollect.cli.ros.env import show_environment

    show_environment(run)


@topic_app.command("list")
def topic_list(types: TypesOption = False, hidden: HiddenOption = False, run: RunOption = None) -> None:
    """List the topics."""
    from throwcollect.cli.ros.topics import show_topics

    show_topics(run, types=types, hidden=hidden)


@topic_app.command("echo")
def topic_echo(
    topic: TopicArgument,
    kind: Annotated[
        str | None,
        typer.Argument(metavar="[TYPE]", help="Type, such as std_msgs/msg/String; needed if nobody publishes."),
    ] = None,
    once: Annotated[bool, typer.Option("--once", help="End after the first message.")] = False,
    field: Annotated[
        str | None, typer.Option("--field", metavar="FIELD", help="Print this field alone, such as pose.pose.position.")
    ] = None,
    full: Annotated[
        bool, typer.Option("-f", "--full-length", help="Print texts and arrays of more than 128 elements in full.")
    ] = False,
    run: RunOption = None,
) -> None:
    """Print the messages of a topic as YAML."""
    from throwcollect.cli.ros.topics import echo

    end_with_reader()
    echo(run, topic, kind, once=once, field=field, full=full)


@topic_app.command("hz")
def topic_hz(
    topic: TopicArgument,
    window: Annotated[
        int, typer.Option("-w", "--window", min=2, metavar="N", help="Number of messages that are averaged.")
    ] = 10_000,
    run: RunOption = None,
) -> None:
    """Print how often messages arrive."""
    from throwcollect.cli.ros.topics import show_rate

    end_with_reader()
    show_rate(run, topic, window=window)


@topic_app.command("info")
def topic_info(
    topic: TopicArgument,
    verbose: Annotated[bool, typer.Option("-v", "--verbose", help="Show every publisher and subscription.")] = False,
    run: RunOption = None,
) -> None:
    """Print the type of a topic and who publishes and subscribes to it."""
    from throwcollect.cli.ros.topics import show_topic

    show_topic(run, topic, verbose=verbose)


@node_app.command("list")
def node_list(hidden: HiddenOption = False, run: RunOption = None) -> None:
    """List the nodes."""
    from throwcollect.cli.ros.nodes import show_nodes

    show_nodes(run, hidden=hidden)


@node_app.command("info")
def node_info(node: NodeArgument, hidden: HiddenOption = False, run: RunOption = None) -> None:
    """Print what a node publishes, subscribes to, offers and uses."""
    from throwcollect.cli.ros.nodes import show_node

    show_node(run, node, hidden=hidden)


@service_app.command("list")
def service_list(types: TypesOption = False, hidden: HiddenOption = False, run: RunOption = None) -> None:
    """List the services."""
    from throwcollect.cli.ros.calls import show_services

    show_services(run, types=types, hidden=hidden)


@service_app.command("call")
def service_call(
    service: Annotated[str, typer.Argument(metavar="SERVICE", help="Name of the service.")],
    kind: Annotated[str, typer.Argument(metavar="TYPE", help="Type, such as std_srvs/srv/Trigger.")],
    values: Annotated[str, typer.Argument(metavar="[VALUES]", help="Fields of the request in YAML.")] = "{}",
    run: RunOption = None,
) -> None:
    """Call a service and print its response."""
    from throwcollect.cli.ros.calls import call

    call(run, service, kind, values)


@action_app.command("list")
def action_list(types: TypesOption = False, run: RunOption = None) -> None:
    """List the actions."""
    from throwcollect.cli.ros.calls import show_actions

    show_actions(run, types=types)


@action_app.command("send_goal", hidden=True)
@action_app.command("send")
def action_send(
    action: Annotated[str, typer.Argument(metavar="ACTION", help="Name of the action.")],
    kind: Annotated[
        str, typer.Argument(metavar="TYPE", help="Type, such as control_msgs/action/FollowJointTrajectory.")
    ],
    goal: Annotated[str, typer.Argument(metavar="GOAL", help="Fields of the goal in YAML.")],
    feedback: Annotated[bool, typer.Option("-f", "--feedback", help="Print feedback, too.")] = False,
    run: RunOption = None,
) -> None:
    """Send a goal and print its result; Ctrl-C cancels the goal."""
    from throwcollect.cli.ros.goals import send

    send(run, action, kind, goal, feedback=feedback)


@param_app.command("list")
def param_list(
    node: Annotated[str | None, typer.Argument(metavar="[NODE]", help="Name of the node; all nodes if none.")] = None,
    run: RunOption = None,
) -> None:
    """List the parameters of a node, or of all nodes."""
    from throwcollect.cli.ros.params import show_parameters

    show_parameters(run, node)


@param_app.command("get")
def param_get(node: NodeArgument, name: ParameterArgument, run: RunOption = None) -> None:
    """Print the value of a parameter."""
    from throwcollect.cli.ros.params import show_value

    show_value(run, node, name)


@param_app.command("set")
def param_set(
    node: NodeArgument,
    name: ParameterArgument,
    value: Annotated[str, typer.Argument(metavar="VALUE", help="Value in YAML.")],
    run: RunOption = None,
) -> None:
    """Set a parameter."""
    from throwcollect.cli.ros.params import change_value

    change_value(run, node, name, value)
