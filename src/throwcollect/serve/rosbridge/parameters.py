"""Parameters of nodes as rosapi reads and sets them: ``/node:parameter``, with values in JSON."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import orjson

from throwcollect import ros
from throwcollect.errors import ConfigError
from throwcollect.ros.graph_names import absolute_name, is_hidden
from throwcollect.ros.message_values import plain
from throwcollect.serve.rosbridge.calls import Call, call_service
from throwcollect.serve.rosbridge.client import refuse_leases

_TIMEOUT_S = 5.0
_NOT_SET = 0
"""Of rcl_interfaces/msg/ParameterType."""
_GET = "rcl_interfaces/srv/GetParameters"
_SET = "rcl_interfaces/srv/SetParameters"
_LIST = "rcl_interfaces/srv/ListParameters"


def get_parameter(call: Call) -> None:
    """Answer with the value of a parameter, or the default that the client gives, in JSON or as a string."""
    asked = call.arguments

    def answer(value: Any) -> None:
        if value is not None:
            call.reply({"value": orjson.dumps(plain(value)).decode()})
        elif asked.default_value:
            call.reply({"value": _as_json(asked.default_value)})
        else:
            call.fail(f"{asked.name}: there is no such node, or it has no such parameter")

    _get(call, answer)


def has_parameter(call: Call) -> None:
    """Answer whether there is a parameter."""
    _get(call, lambda value: call.reply({"exists": value is not None}))


def set_parameter(call: Call) -> None:
    """Set a parameter."""
    node, name = _read_name(call)
    try:
        wanted = orjson.loads(call.arguments.value)
        ros.Parameter(name, value=wanted)
    except (TypeError, ValueError) as error:
        raise ConfigError(f"{call.asked.name}: value should be that of a parameter in JSON: {error}") from error
    if not _is_offered(call, f"{node}/set_parameters"):
        raise ConfigError(f"{node}: there is no such node, or it has no services for its parameters")

    def answer(response: Any) -> None:
        (result,) = response.results
        if result.successful:
            call.reply({"successful": True, "reason": result.reason})
        else:
            call.fail(f"{node}:{name}: {result.reason}")

    def set_like(current: Any) -> None:
        # JavaScript writes 1.0 as 1, so numbers for a floating-point parameter are converted.
        value = _as_floats(wanted) if isinstance(_take_first(current), float) else wanted
        request = ros.get_service(_SET).Request()
        request.parameters = [ros.Parameter(name, value=value).to_parameter_msg()]
        call_service(call.client, f"{node}/set_parameters", _SET, request, answer, call.fail, _TIMEOUT_S)

    _get(call, set_like)


def list_parameters(call: Call) -> None:
    """Answer with the names of the parameters of all nodes that answer in time."""
    services = sorted(call.client.bridge.node.get_service_names_and_types())
    waiting = {service.rpartition("/")[0] for service, types in services if _LIST in types and not is_hidden(service)}
    names: list[str] = []

    def finish(node: str, found: list[str]) -> None:
        waiting.discard(node)
        names.extend(f"{node}:{name}" for name in found)
        if not waiting:
            call.reply({"names": sorted(names)})

    if not waiting:
        call.reply({"names": []})
    for node in sorted(waiting):
        call_service(
            call.client,
            f"{node}/list_parameters",
            _LIST,
            ros.get_service(_LIST).Request(),
            lambda response, node=node: finish(node, response.result.names),  # type: ignore[misc]
            lambda _, node=node: finish(node, []),  # type: ignore[misc]
            _TIMEOUT_S,
        )


def _get(call: Call, answer: Callable[[Any], None]) -> None:
    """Get the value of a parameter, which is None if there is no such node or parameter."""
    node, name = _read_name(call)
    service = f"{node}/get_parameters"

    def take(response: Any) -> None:
        values = [ros.parameter_value_to_python(each) for each in response.values if each.type != _NOT_SET]
        answer(values[0] if values else None)

    if _is_offered(call, service):
        request = ros.get_service(_GET).Request(names=[name])
        call_service(call.client, service, _GET, request, take, call.fail, _TIMEOUT_S)
    else:
        answer(None)


def _is_offered(call: Call, service: str) -> bool:
    return service in dict(call.client.bridge.node.get_service_names_and_types())


def _read_name(call: Call) -> tuple[str, str]:
    """Node and name of a parameter."""
    given = call.arguments.name
    node, separator, name = given.partition(":")
    if not (separator and name):
        raise ConfigError(
            f"{given!r} is no name of a parameter", expected="node:parameter, such as /sim_0:ball.mass_kg"
        )
    refuse_leases(name)
    return absolute_name(node), name


def _as_json(default: str) -> str:
    """Turn the default of a client into JSON: ROS# sends a plain string, all others send JSON."""
    try:
        orjson.loads(default)
    except ValueError:
        return orjson.dumps(default).decode()
    return default


def _take_first(value: Any) -> Any:
    return next(iter(value), None) if isinstance(value, list | tuple) or hasattr(value, "tolist") else value


def _as_floats(value: Any) -> Any:
    if isinstance(value, list):
        return [_as_floats(each) for each in value]
    return float(value) if isinstance(value, int) and not isinstance(value, bool) else value
