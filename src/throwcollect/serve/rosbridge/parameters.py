"""Parameters of nodes as rosapi reads and sets them: ``/node:parameter``, with values in JSON."""

from __future__ import annotations

import time
from typing import Any

import orjson

from throwcollect import ros
from throwcollect.errors import ConfigError
from throwcollect.ros.graph_names import absolute_name, is_hidden
from throwcollect.ros.message_values import plain
from throwcollect.serve.rosbridge.bridge import Client
from throwcollect.serve.rosbridge.calls import call_service
from throwcollect.serve.rosbridge.operations import Arguments

_TIMEOUT_S = 5.0
_NOT_SET = 0
"""Of rcl_interfaces/msg/ParameterType."""


Values = dict[str, object]
"""Fields of a response."""


async def get_parameter(client: Client, asked: Arguments) -> Values:
    """Answer with the value of a parameter, or the default that the client gives, in JSON or as a string."""
    value = await _read(client, asked.name)
    if value is not None:
        return {"value": orjson.dumps(plain(value)).decode()}
    if not asked.default_value:
        raise ConfigError(f"{asked.name}: there is no such node, or it has no such parameter")
    # ROS# sends a plain string, all others send JSON.
    try:
        orjson.loads(asked.default_value)
    except ValueError:
        return {"value": orjson.dumps(asked.default_value).decode()}
    return {"value": asked.default_value}


async def has_parameter(client: Client, asked: Arguments) -> Values:
    """Answer whether there is a parameter."""
    return {"exists": await _read(client, asked.name) is not None}


async def set_parameter(client: Client, asked: Arguments) -> Values:
    """Set a parameter to a value in JSON."""
    node, name = _split_name(asked.name)
    try:
        value = orjson.loads(asked.value)
        ros.Parameter(name, value=value)
    except (TypeError, ValueError) as error:
        raise ConfigError(f"{asked.name}: value should be that of a parameter in JSON: {error}") from error
    if not _offers(client, node, "set"):
        raise ConfigError(f"{node}: there is no such node, or it has no services for its parameters")
    current = await _read(client, asked.name)
    first = next(iter(current), None) if isinstance(current, list | tuple) or hasattr(current, "tolist") else current
    # JavaScript writes 1.0 as 1, so numbers for a floating-point parameter are converted.
    if isinstance(first, float):
        value = _as_floats(value)
    parameter = ros.Parameter(name, value=value).to_parameter_msg()
    (result,) = (await _call(client, node, "set", parameters=[parameter])).results
    if not result.successful:
        raise ConfigError(f"{node}:{name}: {result.reason}")
    return {"successful": True, "reason": result.reason}


async def list_parameters(client: Client, _: Arguments) -> Values:
    """Answer with the names of the parameters of all nodes that answer in time."""
    names, end = [], time.monotonic() + _TIMEOUT_S
    for service, types in client.bridge.node.get_service_names_and_types():
        if "rcl_interfaces/srv/ListParameters" in types and not is_hidden(service):
            node, left_s = service.rpartition("/")[0], end - time.monotonic()
            try:
                response = await _call(client, node, "list", timeout_s=max(left_s, 0.1))
            except ConfigError:
                continue
            names += [f"{node}:{name}" for name in response.result.names]
    return {"names": sorted(names)}


async def _read(client: Client, given: str) -> Any:
    """Value of a parameter, which is None if there is no such node or parameter."""
    node, name = _split_name(given)
    if not _offers(client, node, "get"):
        return None
    response = await _call(client, node, "get", names=[name])
    values = [ros.parameter_value_to_python(each) for each in response.values if each.type != _NOT_SET]
    return values[0] if values else None


async def _call(client: Client, node: str, verb: str, *, timeout_s: float = _TIMEOUT_S, **fields: Any) -> Any:
    type_name = f"rcl_interfaces/srv/{verb.capitalize()}Parameters"
    request = ros.get_service(type_name).Request(**fields)
    return await call_service(client, f"{node}/{verb}_parameters", type_name, request, timeout_s)


def _offers(client: Client, node: str, verb: str) -> bool:
    return f"{node}/{verb}_parameters" in dict(client.bridge.node.get_service_names_and_types())


def _split_name(given: str) -> tuple[str, str]:
    """Node and name of a parameter."""
    node, _, name = given.partition(":")
    if not name:
        expected = "node:parameter, such as /sim_0:ball.mass_kg"
        raise ConfigError(f"{given!r} is no name of a parameter", expected=expected)
    return absolute_name(node), name


def _as_floats(value: Any) -> Any:
    if isinstance(value, list):
        return [_as_floats(each) for each in value]
    return float(value) if isinstance(value, int) and not isinstance(value, bool) else value
