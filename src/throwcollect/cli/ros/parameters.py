"""`throwcollect ros param`: reads and sets a parameter of a node."""

from __future__ import annotations

from typing import Annotated, Any

import typer

from throwcollect import ros
from throwcollect.cli.ros.graph_session import GraphSession, RunOption, join_graph, require_name
from throwcollect.errors import ConfigError, WorkerError
from throwcollect.ros.graph_names import absolute_name

param_app = typer.Typer(help="Parameters: get, set.", no_args_is_help=True)

NodeArgument = Annotated[str, typer.Argument(metavar="NODE", help="Name of the node, with its namespace.")]
ParameterArgument = Annotated[str, typer.Argument(metavar="NAME", help="Name of the parameter.")]

_SERVICE_S = 5.0
"""Longest wait for the parameter services of a node."""
_FIELDS = {
    1: ("Boolean value is:", "bool_value"),
    2: ("Integer value is:", "integer_value"),
    3: ("Double value is:", "double_value"),
    4: ("String value is:", "string_value"),
    5: ("Byte values are:", "byte_array_value"),
    6: ("Boolean values are:", "bool_array_value"),
    7: ("Integer values are:", "integer_array_value"),
    8: ("Double values are:", "double_array_value"),
    9: ("String values are:", "string_array_value"),
}
"""Label and field of each number of rcl_interfaces/msg/ParameterType, with the labels of `ros2 param get`."""


@param_app.command("get")
def show_parameter(node: NodeArgument, name: ParameterArgument, run: RunOption = None) -> None:
    """Print the value of a parameter."""
    from throwcollect.ros.message_values import plain

    with join_graph(run) as session:
        owner = _find_node(session, node)
        values = _ask(session, owner, "GetParameters", names=[name]).values
        if not values:
            require_name("parameter", name, _ask(session, owner, "ListParameters").result.names, of=owner)
        if not values or values[0].type not in _FIELDS:
            print("Parameter not set.")
            return
        label, field = _FIELDS[values[0].type]
        print(label, plain(getattr(values[0], field)))


# A value may be a negative number, which would otherwise be taken for an option.
@param_app.command("set", context_settings={"ignore_unknown_options": True})
def set_parameter(
    node: NodeArgument,
    name: ParameterArgument,
    value: Annotated[str, typer.Argument(metavar="VALUE", help="Value in YAML.")],
    run: RunOption = None,
) -> None:
    """Set a parameter."""
    parameter = _make_parameter(name, value)
    with join_graph(run) as session:
        owner = _find_node(session, node)
        (result,) = _ask(session, owner, "SetParameters", parameters=[parameter]).results
        if not result.successful:
            raise ConfigError(f"setting {name} of {owner} failed: {result.reason}")
        print("Set parameter successful" + (f": {result.reason}" if result.reason else ""))


def _make_parameter(name: str, text: str) -> Any:
    """Make the message of a parameter of the type that its value has in YAML; other types become strings."""
    from throwcollect.cli.ros.yaml_values import parse

    try:
        value = parse(text, "VALUE")
        return ros.Parameter(name, value=text if value is None else value).to_parameter_msg()
    except (TypeError, ConfigError):
        return ros.Parameter(name, value=text).to_parameter_msg()


def _find_node(session: GraphSession, name: str) -> str:
    owner = absolute_name(name)
    nodes = session.node.get_node_names_and_namespaces()
    require_name("node", owner, [f"{namespace.removesuffix('/')}/{each}" for each, namespace in nodes])
    return owner


def _ask(session: GraphSession, node: str, service: str, **fields: Any) -> Any:
    service_type: Any = ros.get_service(f"rcl_interfaces/srv/{service}")
    snake = "".join(f"_{letter.lower()}" if letter.isupper() else letter for letter in service).strip("_")
    client = session.node.create_client(service_type, f"{node}/{snake}")
    if not client.wait_for_service(timeout_sec=_SERVICE_S):
        raise WorkerError(f"{node} offers no {snake}")
    future = client.call_async(service_type.Request(**fields))
    response = session.answer(future, alive=client.service_is_ready, who=node)
    session.node.destroy_client(client)
    return response
