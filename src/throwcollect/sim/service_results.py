"""Answers of the services of simulation_interfaces: a result code, and a sentence on errors."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Protocol, TypeVar

from throwcollect.errors import ConfigError, RequestError
from throwcollect.ros.msg import Result

Fill = Callable[[Any, Any], None]
"""Fills a response: gets request and response."""


def answering(service: Any, fill: Fill) -> Callable[[Any, Any], Any]:
    """Make the callback of a service, which fills the response, or answers with the error that `fill` raises."""

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
    """Response, or any other message with a ``result``, that gives the reason of an error.

    A code that the message has of its own comes before one of the same name that all services have.
    """
    constants = response_type if hasattr(response_type, error.reason) else Result
    response = response_type()
    response.result.result = getattr(constants, error.reason)
    response.result.error_message = str(error)
    return response
