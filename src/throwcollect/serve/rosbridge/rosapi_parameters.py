"""Parameters of nodes as rosapi reads and sets them: ``/node:parameter``, with values in JSON."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any

import orjson

from throwcollect import ros
from throwcollect.errors import ConfigError
from throwcollect.ros.graph_names import absolute_name, is_hidden
from throwcollect.ros.message_values import plain
from throwcollect.serve.rosbridge.errands import Questions
from throwcollect.serve.rosbridge.guarded import refuse_leases
from throwcollect.serve.rosbridge.peer import Peer
from throwcollect.serve.rosbridge.request import sentence
from throwcollect.serve.rosbridge.service_calls import Call

_TIMEOUT_S = 5.0
_NOT_SET = 0
"""Of rcl_interfaces/msg/ParameterType."""
_GET = "rcl_interfaces/srv/GetParameters"
_SET = "rcl_interfaces/srv/SetParameters"
_LIST = "rcl_interfaces/srv/ListParameters"


class Parameters:
    """The services of rosapi for parameters, for one client."""

    def __init__(self, client: Peer, questions: Questions) -> None:
        self._client = client
        self._questions = questions

    def get(self, call: Call) -> None:
        """Answer with the value of a parameter, or the default that the client gives, in JSON or as a text."""
        default = call.fields.text_or("default_value", "")

        def answer(value: Any) -> None:
            if value.type != _NOT_SET:
                call.reply({"value": orjson.dumps(plain(ros.parameter_value_to_python(value))).decode()})
            elif default:
                call.reply({"value": _as_json(default)})
            else:
                call.fail(f"{call.fields.text('name')}: there is no such node, or it has no such parameter")

        self._get(call, answer)

    def has(self, call: Call) -> None:
        """Answer whether there is a parameter."""
        self._get(call, lambda value: call.reply({"exists": value.type != _NOT_SET}))

    def set(self, call: Call) -> None:
        """Set a parameter."""
        node, name = _read_name(call)
        try:
            wanted = orjson.loads(call.fields.text("value"))
            ros.Parameter(name, value=wanted)
        except (TypeError, ValueError) as error:
            raise ConfigError(f"{call.given}: value should be that of a parameter in JSON: {error}") from error

        def answer(response: Any) -> None:
            (result,) = response.results
            if result.successful:
                call.reply({"successful": True, "reason": result.reason})
            else:
                call.fail(f"{node}:{name}: {result.reason}")

        def set_like(current: Any) -> None:
            if not self._is_offered(f"{node}/set_parameters"):
                call.fail(f"{node}: there is no such node, or it tells nobody of its parameters")
                return
            # JavaScript writes 1.0 as 1, so numbers for a floating-point parameter are converted.
            value = (
                _as_floats(wanted) if isinstance(_take_first(ros.parameter_value_to_python(current)), float) else wanted
            )
            request = ros.get_service(_SET).Request()
            request.parameters = [ros.Parameter(name, value=value).to_parameter_msg()]
            try:
                self._questions.ask(f"{node}/set_parameters", _SET, request, answer, call.fail, _TIMEOUT_S)
            except ConfigError as error:
                # This is a callback, whose errors nobody catches, so it has to answer the call itself.
                call.fail(sentence(error))

        self._get(call, set_like)

    def delete(self, call: Call) -> None:
        """Answer that parameters of nodes cannot be deleted."""
        call.fail(f"{call.given}: parameters of nodes cannot be deleted")

    def list_all(self, call: Call) -> None:
        """Answer with the names of the parameters of all nodes that answer in time."""
        session = self._client.host.session
        offered = dict(session.node.get_service_names_and_types())
        nodes = [
            service.rpartition("/")[0]
            for service, types in sorted(offered.items())
            if _LIST in types and not is_hidden(service)
        ]
        names: list[str] = []
        waits_for = len(nodes)

        def finish(node: str, response: Any) -> None:
            nonlocal waits_for
            waits_for -= 1
            if response is not None:
                names.extend(f"{node}:{name}" for name in response.result.names)
            if waits_for == 0:
                call.reply({"names": sorted(names)})

        if not nodes:
            call.reply({"names": []})
        for node in nodes:
            self._questions.ask(
                f"{node}/list_parameters",
                _LIST,
                ros.get_service(_LIST).Request(),
                partial(finish, node),
                lambda _, node=node: finish(node, None),  # type: ignore[misc]
                _TIMEOUT_S,
            )

    def _get(self, call: Call, answer: Callable[[Any], None]) -> None:
        """Get the value of a parameter; if there is no such node, `answer` gets a value that is not set."""
        node, name = _read_name(call)
        unset = ros.get_message("rcl_interfaces/msg/ParameterValue")()

        def take(response: Any) -> None:
            answer(response.values[0] if response.values else unset)

        if self._is_offered(f"{node}/get_parameters"):
            request = ros.get_service(_GET).Request(names=[name])
            self._questions.ask(f"{node}/get_parameters", _GET, request, take, call.fail, _TIMEOUT_S)
        else:
            answer(unset)

    def _is_offered(self, service: str) -> bool:
        return service in dict(self._client.host.session.node.get_service_names_and_types())


def _read_name(call: Call) -> tuple[str, str]:
    """Node and name of a parameter."""
    given = call.fields.text("name")
    node, separator, name = given.partition(":")
    if not (separator and name):
        raise ConfigError(
            f"{given!r} is no name of a parameter", expected="node:parameter, such as /sim_0:ball.mass_kg"
        )
    refuse_leases(name)
    return absolute_name(node), name


def _as_json(default: str) -> str:
    """Turn the default of a client into JSON: ROS# sends a plain text, all others send JSON."""
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
