"""Makes the answers of the services of simulation_interfaces: a result code, and a sentence if there is an error."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Protocol, TypeVar

from throwcollect.errors import ConfigError, MemberError, RequestError
from throwcollect.ros import Node
from throwcollect.ros.msg import Result

Fill = Callable[[Any, Any], None]
"""Function of a request and a response that fills the response."""


def offer(node: Node, service: Any, name: str, fill: Fill) -> None:
    """Offer a service of a node: `fill` fills the response, or raises an error, with which the service answers."""

    def answer(request: Any, response: Any) -> Any:
        response.result.result = Result.RESULT_OK
        try:
            fill(request, response)
        except RequestError as error:
            return refusal(service.Response, error)
        except (ConfigError, MemberError) as error:
            return refusal(service.Response, RequestError("RESULT_OPERATION_FAILED", str(error)))
        return response

    node.create_service(service, name, answer)


class _WithResult(Protocol):
    result: Result


_R = TypeVar("_R", bound=_WithResult)


def refusal(response_type: type[_R], error: RequestError) -> _R:
    """Make a response, or any other message with a ``result``, that gives the reason of an error.

    If the type of the message and all services have a result code of the same name, the code of the type is taken.
    """
    constants = response_type if hasattr(response_type, error.reason) else Result
    response = response_type()
    response.result.result = getattr(constants, error.reason)
    response.result.error_message = str(error)
    return response
