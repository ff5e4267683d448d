"""`throwcollect ros node`: lists nodes, and shows what a node has."""

from __future__ import annotations

import sys

import typer

from throwcollect import ros
from throwcollect.cli.ros.graph_session import join_graph, require_name
from throwcollect.cli.ros.ros_options import HiddenOption, NodeArgument, RunOption
from throwcollect.ros.graph_names import absolute_name, is_hidden

node_app = typer.Typer(help="Nodes: list, info.", no_args_is_help=True)


@node_app.command("list")
def list_nodes(hidden: HiddenOption = False, run: RunOption = None) -> None:
    """List the nodes."""
    with join_graph(run) as session:
        names = [name for name in session.node_names() if hidden or not is_hidden(name)]
        if len(set(names)) < len(names):
            print("warning: several nodes have the same name", file=sys.stderr)
        for name in names:
            print(name)


@node_app.command("info")
def show_node(node: NodeArgument, hidden: HiddenOption = False, run: RunOption = None) -> None:
    """Print what a node publishes, subscribes to, offers and uses."""
    with join_graph(run) as session:
        full_name = absolute_name(node)
        names = session.node_names()
        require_name("node", full_name, names)
        if (count := names.count(full_name)) > 1:
            print(f"warning: {count} nodes are named {full_name}; this is what they have together", file=sys.stderr)
        namespace, _, short = full_name.rpartition("/")
        owner = (short, namespace or "/")
        ours = session.node
        print(full_name)
        for what, names_and_types in (
            ("Subscribers", ours.get_subscriber_names_and_types_by_node(*owner)),
            ("Publishers", ours.get_publisher_names_and_types_by_node(*owner)),
            ("Service Servers", ours.get_service_names_and_types_by_node(*owner)),
            ("Service Clients", ours.get_client_names_and_types_by_node(*owner)),
            ("Action Servers", ros.get_action_server_names_and_types_by_node(ours, *owner)),
            ("Action Clients", ros.get_action_client_names_and_types_by_node(ours, *owner)),
        ):
            print(f"  {what}:")
            for owned, types in sorted(names_and_types):
                if hidden or not is_hidden(owned):
                    print(f"    {owned}: {', '.join(types)}")
