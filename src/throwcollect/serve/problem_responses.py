"""Errors as answers: a status, and all facts as `application/problem+json` (RFC 9457)."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from fastapi import WebSocket
from fastapi.exceptions import RequestValidationError
from fastapi.responses import JSONResponse
from pydantic import BaseModel
from starlette.exceptions import HTTPException
from starlette.requests import HTTPConnection

from throwcollect.errors import (
    ConfigError,
    ConflictError,
    DatasetError,
    NotFoundError,
    Problem,
    ThrowcollectError,
    WorkerError,
)
from throwcollect.extras import MissingExtraError
from throwcollect.serve.sockets import close

_STATUS: tuple[tuple[type[ThrowcollectError], int], ...] = (
    (NotFoundError, 404),
    (ConflictError, 409),
    (ConfigError, 422),
    (DatasetError, 409),
    (MissingExtraError, 503),
    (WorkerError, 503),
)
"""Status of each kind of error, the first that fits; that of any other is 500."""


class ProblemFacts(BaseModel):
    """What the answer to a request with an error consists of."""

    title: str
    """Where and what."""
    status: int
    expected: str | None = None
    """What would have been right."""
    evidence: str | None = None
    """What was seen."""
    hint: str | None = None
    """What gets further."""
    problems: list[dict[str, Any]] | None = None
    """Each key that is wrong, with a message."""


class ProblemResponse(JSONResponse):
    """A problem by RFC 9457."""

    media_type = "application/problem+json"


def make_problem(status: int, title: str, headers: dict[str, str] | None = None, **facts: Any) -> ProblemResponse:
    """Make the answer that describes a problem: status, title, and those of the further ``facts`` that are not None."""
    content = ProblemFacts(title=title, status=status, **facts).model_dump(exclude_none=True)
    return ProblemResponse(content, status_code=status, headers=headers)


def answer(error: ThrowcollectError) -> ProblemResponse:
    """Make the answer that describes one of our own errors."""
    status = next((status for kind, status in _STATUS if isinstance(error, kind)), 500)
    problems = getattr(error, "problems", None)
    facts = {
        "problems": problems and [{"message": each.message, "key": each.key, "line": each.line} for each in problems],
        **{name: getattr(error, name) for name in ("expected", "evidence", "hint")},
    }
    return make_problem(status, error.message, **facts)


async def answer_any(connection: HTTPConnection, error: Exception) -> ProblemResponse | None:
    """Answer an error of any kind: our own, one that FastAPI or Starlette raises, or an unexpected one."""
    match error:
        case ThrowcollectError() if isinstance(connection, WebSocket):
            await close(connection, error)
            return None
        case ThrowcollectError():
            return answer(error)
        case RequestValidationError():
            return answer(ConfigError([_describe(each) for each in error.errors()]))
        case HTTPException():
            return make_problem(error.status_code, str(error.detail), headers=dict(error.headers or {}))
    # Starlette raises the error again after this answer, so that it gets into the log.
    return make_problem(500, "internal error", hint="the log of the server has the place; please report it")


DESCRIPTION: dict[int | str, dict[str, Any]] = {
    "default": {
        "description": "An error",
        "content": {ProblemResponse.media_type: {"schema": ProblemFacts.model_json_schema()}},
    }
}
"""The part of the description of the interface that is on errors."""
HANDLERS: dict[int | type[Exception], Any] = dict.fromkeys(
    (ThrowcollectError, RequestValidationError, HTTPException, Exception), answer_any
)
"""The handlers of errors of the application."""


def _describe(error: Mapping[str, Any]) -> Problem:
    """Describe one value of a request that FastAPI rejects; the first part of its place is ``body`` or ``query``."""
    part, *place = error["loc"]
    key = "" if error["type"] == "json_invalid" else ".".join(map(str, place))
    return Problem(error["msg"] if key else f"{part}: {error['msg']}", key=key)
