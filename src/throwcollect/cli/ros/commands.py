"""`throwcollect ros`: what `ros2` is needed for at a run, for machines without ROS 2."""

from __future__ import annotations

import io
import shlex
import time
from operator import attrgetter
from typing import Annotated, Any

import typer

from throwcollect import ros
from throwcollect.cli.options import RunOption as ShellRunOption
from throwcollect.cli.ros.graph_session import (
    GraphSession,
    RunOption,
    find_run_and_connection,
    join_graph,
    require_name,
)
from throwcollect.cli.streams import has_reader
from throwcollect.errors import ConfigError, Interrupted, ThrowcollectError
from throwcollect.files import write_file
from throwcollect.ros.graph_names import absolute_name, find_interface, find_offered_qos, is_hidden
from throwcollect.wording import command

ros_app = typer.Typer(help="Look into the ROS graph, as the command `ros2` does.", no_args_is_help=True)
topic_app = typer.Typer(help="Topics: list, echo, hz.", no_args_is_help=True)
action_app = typer.Typer(help="Actions: send.", no_args_is_help=True)
param_app = typer.Typer(help="Parameters: get, set.", no_args_is_help=True)
ros_app.add_typer(topic_app, name="topic")
ros_app.add_typer(action_app, name="action")
ros_app.add_typer(param_app, name="param")

NodeArgument = Annotated[str, typer.Argument(metavar="NODE", help="Name of the node, with its namespace.")]
TopicArgument = Annotated[str, typer.Argument(metavar="TOPIC", help="Name of the topic.")]
ParameterArgument = Annotated[str, typer.Argument(metavar="NAME", help="Name of the parameter.")]

_PROFILE = "fast_dds.xml"
_DEPTH = 100
"""Messages that wait for `hz` to count them."""
_PERIOD_S = 1.0
_SERVICE_S = 5.0
"""Longest wait for the parameter services of a node."""
_STATUSES = ("UNKNOWN", "ACCEPTED", "EXECUTING", "CANCELING", "SUCCEEDED", "CANCELED", "ABORTED")
"""Names of the numbers of action_msgs/msg/GoalStatus."""


@ros_app.command("env")
def env(run: ShellRunOption = None) -> None:
    """Print the line that lets a shell's ROS 2 nodes join a run: eval "$(throwcollect ros env)"."""
    from throwcollect.ros.fast_dds import PLAIN_DISCOVERY, PROFILE_VARIABLE, client_profile
    from throwcollect.ros.middleware import RMW_VARIABLE

    found, connection = find_run_and_connection(run)
    middleware = found.record.middleware
    # The variables name files and hold no secret, because others may read the environment of a process.
    variables = {**connection.environment(), RMW_VARIABLE: middleware.rmw}
    if middleware.is_fast_dds:
        profile = found.key.directory.parent / _PROFILE
        write_file(profile, client_profile(connection.endpoint).encode(), mode=0o600)
        variables |= {PROFILE_VARIABLE: str(profile), **PLAIN_DISCOVERY}
    typer.echo("export " + " ".join(f"{name}={shlex.quote(value)}" for name, value in variables.items()))


@topic_app.command("list")
def list_topics(
    types: Annotated[bool, typer.Option("-t", "--show-types", help="Show the types, too.")] = False,
    run: RunOption = None,
) -> None:
    """List the topics."""
    with join_graph(run) as session:
        for name, kinds in sorted(session.node.get_topic_names_and_types()):
            if not is_hidden(name):
                print(f"{name} [{', '.join(kinds)}]" if types else name)


@topic_app.command("echo")
def echo(
    topic: TopicArgument,
    once: Annotated[bool, typer.Option("--once", help="End after the first message.")] = False,
    field: Annotated[
        str | None, typer.Option("--field", metavar="FIELD", help="Print this field alone, such as pose.pose.position.")
    ] = None,
    run: RunOption = None,
) -> None:
    """Print the messages of a topic as YAML."""
    from throwcollect.ros.message_values import plain

    with join_graph(run) as session:
        name, message_type = _find_message_type(session, topic)
        printed = False

        def show(message: Any) -> None:
            nonlocal printed
            # Further messages may have arrived before the command gets to its end.
            if once and printed:
                return
            printed = True
            try:
                value = plain(attrgetter(field)(message) if field else message)
            except AttributeError as error:
                raise ConfigError(f"--field {field}: {error}") from error
            print(_write_yaml(value), end="---\n", flush=True)

        qos = find_offered_qos(session.node, name, ros.ReliabilityPolicy.BEST_EFFORT)
        session.node.create_subscription(message_type, name, show, qos)
        session.spin_until(lambda: (once and printed) or not has_reader())


@topic_app.command("hz")
def show_rate(topic: TopicArgument, run: RunOption = None) -> None:
    """Print every second how many messages have arrived in it."""
    with join_graph(run) as session:
        name, message_type = _find_message_type(session, topic)
        arrived: list[bytes] = []
        # A subscription that asks for less than the publisher offers is served; the other way round, nothing arrives.
        qos = ros.QoSProfile(depth=_DEPTH, reliability=ros.ReliabilityPolicy.BEST_EFFORT)
        session.node.create_subscription(message_type, name, arrived.append, qos, raw=True)
        while has_reader():
            end = (begin := time.monotonic()) + _PERIOD_S
            session.spin_until(lambda end=end: time.monotonic() >= end)  # type: ignore[misc]
            print(f"average rate: {len(arrived) / (time.monotonic() - begin):.3f}", flush=True)
            arrived.clear()


def _find_message_type(session: GraphSession, topic: str) -> tuple[str, Any]:
    """Find the absolute name of a topic and the class of its messages."""
    name, topics = absolute_name(topic), dict(session.node.get_topic_names_and_types())
    require_name("topic", name, (each for each in topics if not is_hidden(each) or each == name))
    return name, find_interface("msg", topics[name][0])


@action_app.command("send")
def send_goal(
    action: Annotated[str, typer.Argument(metavar="ACTION", help="Name of the action.")],
    kind: Annotated[
        str, typer.Argument(metavar="TYPE", help="Type, such as control_msgs/action/FollowJointTrajectory.")
    ],
    goal: Annotated[str, typer.Argument(metavar="GOAL", help="Fields of the goal in YAML.")],
    feedback: Annotated[bool, typer.Option("-f", "--feedback", help="Print feedback, too.")] = False,
    run: RunOption = None,
) -> None:
    """Send a goal and print its result; Ctrl-C cancels the goal."""
    from throwcollect.ros.message_values import fill

    action_type = find_interface("action", kind)
    message = action_type.Goal()
    fill(message, _parse(goal, "GOAL"))
    with join_graph(run) as session:
        name = absolute_name(action)
        actions = dict(ros.get_action_names_and_types(session.node))
        require_name("action", name, actions)
        client = ros.ActionClient(session.node, action_type, name)
        if not client.server_is_ready():
            raise ConfigError(f"no node offers {name} as {kind}", expected=", ".join(actions[name]))
        print(f"Sending goal:\n{_indent(message)}", flush=True)
        sent = client.send_goal_async(message, feedback_callback=_show_feedback if feedback else None)
        try:
            handle = session.answer(sent, alive=client.server_is_ready, who=name)
            if not handle.accepted:
                echo = command("ros", "topic", "echo", "/rosout", *(("--run", run) if run is not None else ()))
                raise ConfigError(f"{name}: the goal was rejected", hint=f"the log of the node has the reason: {echo}")
            print(f"Goal accepted with ID: {bytes(bytearray(handle.goal_id.uuid)).hex()}\n", flush=True)
            response = session.answer(handle.get_result_async(), alive=client.server_is_ready, who=name)
        except KeyboardInterrupt:
            # Otherwise `join_graph` would only leave the graph, and the goal would go on. It may not be accepted yet.
            handle = session.answer(sent, alive=client.server_is_ready, who=name)
            if handle.accepted:
                _cancel(session, client, handle, name)
            raise Interrupted("") from None
        status = _STATUSES[response.status]
        print(f"Result:\n{_indent(response.result)}")
        print(f"Goal finished with status: {status}", flush=True)
    if status != "SUCCEEDED":
        raise ThrowcollectError(f"{name}: the goal was not reached: {status}")


def _cancel(session: GraphSession, client: ros.ActionClient, handle: Any, name: str) -> None:
    print("Canceling goal...", flush=True)
    response = session.answer(handle.cancel_goal_async(), alive=client.server_is_ready, who=name)
    print("Goal canceled." if response.goals_canceling else "The goal cannot be canceled.", flush=True)


def _show_feedback(message: Any) -> None:
    print(f"Feedback:\n{_indent(message.feedback)}", flush=True)


def _indent(message: Any) -> str:
    from throwcollect.ros.message_values import plain

    return "".join(f"    {line}\n" for line in _write_yaml(plain(message)).splitlines())


@param_app.command("get")
def show_parameter(node: NodeArgument, name: ParameterArgument, run: RunOption = None) -> None:
    """Print the value of a parameter as YAML."""
    with join_graph(run) as session:
        values = _ask(session, node, "get_parameters", names=[name]).values
        if not values:
            raise ConfigError(f"{node} has no parameter {name}")
        print(_write_yaml(ros.parameter_value_to_python(values[0])), end="")


# A value may be a negative number, which would otherwise be taken for an option.
@param_app.command("set", context_settings={"ignore_unknown_options": True})
def set_parameter(
    node: NodeArgument,
    name: ParameterArgument,
    value: Annotated[str, typer.Argument(metavar="VALUE", help="Value in YAML; a string if it is no other type's.")],
    run: RunOption = None,
) -> None:
    """Set a parameter."""
    try:
        parsed = _parse(value, "VALUE")
        parameter = ros.Parameter(name, value=value if parsed is None else parsed)
    except (TypeError, ConfigError):
        parameter = ros.Parameter(name, value=value)
    with join_graph(run) as session:
        (result,) = _ask(session, node, "set_parameters", parameters=[parameter.to_parameter_msg()]).results
        if not result.successful:
            raise ConfigError(f"setting {name} of {node} failed: {result.reason}")
        print("Set parameter successful")


def _ask(session: GraphSession, node: str, service: str, **fields: Any) -> Any:
    kind: Any = ros.get_service(f"rcl_interfaces/srv/{service.title().replace('_', '')}")
    client = session.node.create_client(kind, f"{absolute_name(node)}/{service}")
    if not client.wait_for_service(timeout_sec=_SERVICE_S):
        raise ConfigError(f"no node {node} offers {service}")
    return session.answer(client.call_async(kind.Request(**fields)), alive=client.service_is_ready, who=node)


def _parse(text: str, what: str) -> Any:
    """Read a value from YAML, which is the argument `what` of a command."""
    # This takes a while, and every command of throwcollect loads this module.
    from ruamel.yaml import YAML
    from ruamel.yaml.error import YAMLError

    try:
        return YAML(typ="safe", pure=True).load(text)
    except (YAMLError, ValueError) as error:
        raise ConfigError(f"{what}: not YAML: {str(error).splitlines()[0]}, got {text!r:.80}") from error


def _write_yaml(value: Any) -> str:
    """Write a value as YAML, in block style, with its fields in their order."""
    from ruamel.yaml import YAML

    writer = YAML(typ="safe", pure=True)
    writer.default_flow_style = False
    writer.allow_unicode = True
    writer.width = 1 << 30
    writer.sort_base_mapping_type_on_output = False  # type: ignore[assignment]
    stream = io.StringIO()
    writer.dump(value, stream)
    text = stream.getvalue()
    # ruamel.yaml ends a document that is a single scalar with this line; `ros2` does not.
    return text.removesuffix("...\n") if text.endswith("\n...\n") else text
