"""`throwcollect ros node`: who is there and has what."""

from __future__ import annotations

import sys

from throwcollect.cli.ros.session import Session, absolute, is_hidden, joined, known
from throwcollect.ros import get_action_client_names_and_types_by_node, get_action_server_names_and_types_by_node


def show_nodes(run: str | None, *, hidden: bool) -> None:
    """Print the names of all nodes but our own."""
    with joined(run) as session:
        names = [name for name in node_names(session) if hidden or not is_hidden(name)]
        if len(set(names)) < len(names):
            print("warning: several nodes have the same name", file=sys.stderr)
        for name in names:
            print(name)


def show_node(run: str | None, name: str, *, hidden: bool) -> None:
    """Print what a node has.

    Raises:
        ConfigError: If there is no such node.
    """
    with joined(run) as session:
        full_name = absolute(name)
        names = node_names(session)
        known("node", full_name, names)
        if (count := names.count(full_name)) > 1:
            print(f"warning: {count} nodes are named {full_name}; this is what they have together", file=sys.stderr)
        namespace, _, short = full_name.rpartition("/")
        owner = (short, namespace or "/")
        node = session.node
        print(full_name)
        for what, found in (
            ("Subscribers", node.get_subscriber_names_and_types_by_node(*owner)),
            ("Publishers", node.get_publisher_names_and_types_by_node(*owner)),
            ("Service Servers", node.get_service_names_and_types_by_node(*owner)),
            ("Service Clients", node.get_client_names_and_types_by_node(*owner)),
            ("Action Servers", get_action_server_names_and_types_by_node(node, *owner)),
            ("Action Clients", get_action_client_names_and_types_by_node(node, *owner)),
        ):
            print(f"  {what}:")
            for each, types in sorted(found):
                if hidden or not is_hidden(each):
                    print(f"    {each}: {', '.join(types)}")


def node_names(session: Session) -> list[str]:
    """Absolute names of all nodes but our own, sorted."""
    found = session.node.get_node_names_and_namespaces()
    own = session.node.get_name()
    return sorted(f"{namespace.removesuffix('/')}/{name}" for name, namespace in found if name != own)
