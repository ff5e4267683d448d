"""How the services of simulation_interfaces answer: with a result code, and in words if something is wrong."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Protocol, TypeVar

from throwcollect.errors import ConfigError, RequestError
from throwcollect.ros.msg import Result

Fill = Callable[[Any, Any], None]
"""Fills a response: gets request and response."""


def answering(service: Any, fill: Fill) -> Callable[[Any, Any], Any]:
    """Callback of a service that answers with what went wrong instead of failing.

    Args:
        service: Class of the service.
        fill: Fills the response; the result is set if it raises nothing.
    """

    def answer(request: Any, response: Any) -> Any:
        response.result.result = Result.RESULT_OK
        try:
            fill(request, response)
        except RequestError as error:
            return refusal(service.Response, error)
        except ConfigError as error:
            return refusal(service.Response, RequestError("RESULT_OPERATION_FAILED", str(error)))
        return response

    return answer


class _WithResult(Protocol):
    result: Result


_R = TypeVar("_R", bound=_WithResult)


def refusal(response_type: type[_R], error: RequestError) -> _R:
    """Response, or any other message with a ``result``, that says why something cannot be done.

    Args:
        response_type: Its class, whose constants are looked at before those of all services.
        error: What is wrong.
    """
    constants = response_type if hasattr(response_type, error.reason) else Result
    response = response_type()
    response.result.result = getattr(constants, error.reason)
    response.result.error_message = str(error)
    return response
