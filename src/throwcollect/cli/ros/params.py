"""`throwcollect ros param`: parameters of nodes, read and set."""

from __future__ import annotations

import sys
from typing import Any

from throwcollect.cli.ros.nodes import node_names
from throwcollect.cli.ros.session import Session, absolute, is_hidden, joined, known
from throwcollect.cli.ros.values import parse, plain
from throwcollect.errors import ConfigError, WorkerError
from throwcollect.ros import Parameter, get_service

_SERVICE_S = 5.0
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
"""By rcl_interfaces/msg/ParameterType."""


def show_parameters(run: str | None, node: str | None) -> None:
    """Print the names of the parameters of a node, or of all nodes.

    Raises:
        ConfigError: If there is no such node.
        WorkerError: If the node does not answer.
    """
    with joined(run) as session:
        if node is not None:
            name = _node(session, node)
            _print_sorted(_ask(session, name, "ListParameters").result.names)
            return
        for name in sorted({each for each in node_names(session) if not is_hidden(each)}):
            try:
                names = _ask(session, name, "ListParameters").result.names
            except WorkerError as error:
                print(error, file=sys.stderr)
                continue
            print(f"{name}:")
            _print_sorted(names)


def show_value(run: str | None, node: str, name: str) -> None:
    """Print the value of a parameter.

    Raises:
        ConfigError: If there is no such node or parameter.
        WorkerError: If the node does not answer.
    """
    with joined(run) as session:
        owner = _node(session, node)
        values = _ask(session, owner, "GetParameters", names=[name]).values
        if not values:
            known("parameter", name, _ask(session, owner, "ListParameters").result.names, of=owner)
        if not values or values[0].type not in _FIELDS:
            print("Parameter not set.")
            return
        label, field = _FIELDS[values[0].type]
        print(label, plain(getattr(values[0], field)))


def change_value(run: str | None, node: str, name: str, text: str) -> None:
    """Set a parameter.

    Raises:
        ConfigError: If there is no such node or parameter, or it refuses the value.
        WorkerError: If the node does not answer.
    """
    wanted = _parameter(name, text).to_parameter_msg()
    with joined(run) as session:
        owner = _node(session, node)
        (result,) = _ask(session, owner, "SetParameters", parameters=[wanted]).results
        if not result.successful:
            raise ConfigError(f"setting {name} of {owner} failed: {result.reason}")
        print("Set parameter successful" + (f": {result.reason}" if result.reason else ""))


def _parameter(name: str, text: str) -> Parameter:
    """A parameter of the type that its value has in YAML; what is of no such type is a text."""
    try:
        value = parse(text, "VALUE")
        return Parameter(name, value=text if value is None else value)
    except (TypeError, ConfigError):
        return Parameter(name, value=text)


def _node(session: Session, name: str) -> str:
    owner = absolute(name)
    known("node", owner, node_names(session))
    return owner


def _ask(session: Session, node: str, service: str, **fields: Any) -> Any:
    service_type: Any = get_service(f"rcl_interfaces/srv/{service}")
    snake = "".join(f"_{letter.lower()}" if letter.isupper() else letter for letter in service).strip("_")
    client = session.node.create_client(service_type, f"{node}/{snake}")
    if not client.wait_for_service(timeout_sec=_SERVICE_S):
        raise WorkerError(f"{node} offers no {snake}")
    future = client.call_async(service_type.Request(**fields))
    response = session.answer(future, alive=client.service_is_ready, who=node)
    session.node.destroy_client(client)
    return response


def _print_sorted(names: list[str]) -> None:
    for name in sorted(names):
        print(f"  {name}")
