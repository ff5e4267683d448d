"""`throwcollect ros topic`: lists topics, and prints their messages and rates."""

from __future__ import annotations

import time
from operator import attrgetter
from typing import Annotated, Any

import typer

from throwcollect import ros
from throwcollect.cli.ros.graph_session import GraphSession, RunOption, join_graph, require_name
from throwcollect.cli.streams import has_reader
from throwcollect.errors import ConfigError
from throwcollect.ros.graph_names import absolute_name, find_interface, find_offered_qos, is_hidden

topic_app = typer.Typer(help="Topics: list, echo, hz.", no_args_is_help=True)

TopicArgument = Annotated[str, typer.Argument(metavar="TOPIC", help="Name of the topic.")]

_DEPTH = 100
"""Messages that wait for `hz` to count them."""
_PERIOD_S = 1.0


@topic_app.command("list")
def list_topics(
    types: Annotated[bool, typer.Option("-t", "--show-types", help="Show the types, too.")] = False,
    hidden: Annotated[
        bool, typer.Option("-a", "--all", help="Show what is hidden, too: names that begin with '_'.")
    ] = False,
    run: RunOption = None,
) -> None:
    """List the topics."""
    with join_graph(run) as session:
        for name, kinds in sorted(session.node.get_topic_names_and_types()):
            if hidden or not is_hidden(name):
                print(f"{name} [{', '.join(kinds)}]" if types else name)


@topic_app.command("echo")
def echo(
    topic: TopicArgument,
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
    from throwcollect.cli.ros.yaml_values import shorten, yaml_text
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
            print(yaml_text(value if full else shorten(value)), end="---\n", flush=True)

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
