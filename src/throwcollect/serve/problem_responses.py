"""Errors as answers: a status, and all facts as `application/problem+json` (RFC 9457)."""

from __future__ import annotations

from collections.abc import Mapping
from http import HTTPStatus
from typing import Any

from fastapi import FastAPI, Request
from fastapi.exceptions import RequestValidationError
from fastapi.responses import JSONResponse
from starlette.exceptions import HTTPException

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

_STATUS: tuple[tuple[type[ThrowcollectError], int], ...] = (
    (NotFoundError, 404),
    (ConflictError, 409),
    (ConfigError, 422),
    (DatasetError, 409),
    (MissingExtraError, 503),
    (WorkerError, 503),
)
"""Status of each kind of error, the first that fits; that of any other is 500."""

_SCHEMA = {
    "type": "object",
    "required": ["title", "status"],
    "properties": {
        "title": {"type": "string", "description": "Where and what."},
        "status": {"type": "integer"},
        "expected": {"type": "string", "description": "What would have been right."},
        "evidence": {"type": "string", "description": "What was seen."},
        "hint": {"type": "string", "description": "What gets further."},
        "problems": {"type": "array", "items": {"type": "object"}, "description": "Each key that is wrong."},
    },
}


class ProblemResponse(JSONResponse):
    """A problem by RFC 9457."""

    media_type = "application/problem+json"


def problem(status: int, title: str, headers: dict[str, str] | None = None, **facts: Any) -> ProblemResponse:
    """Make the answer that describes a problem: status, title, and those of the further ``facts`` that are not None."""
    content = {"title": title, "status": status, **{key: value for key, value in facts.items() if value is not None}}
    return ProblemResponse(content, status_code=status, headers=headers)


def describe_bytes(media_type: str) -> dict[int | str, dict[str, Any]]:
    """Describe an answer that is no JSON, for the description of a request."""
    return {200: {"description": "OK", "content": {media_type: {}}}}


def describe_problems(*statuses: int) -> dict[int | str, dict[str, Any]]:
    """Describe the problems of some statuses, for the description of a request."""
    content = {ProblemResponse.media_type: {"schema": _SCHEMA}}
    return {status: {"description": HTTPStatus(status).phrase, "content": content} for status in statuses}


def answer(error: ThrowcollectError) -> ProblemResponse:
    """Make the answer that describes one of our own errors."""
    status = next((status for kind, status in _STATUS if isinstance(error, kind)), 500)
    problems = None
    if isinstance(error, ConfigError):
        problems = [{"message": each.message, "key": each.key, "line": each.line} for each in error.problems]
    return problem(
        status, error.message, expected=error.expected, evidence=error.evidence, hint=error.hint, problems=problems
    )


def add_handlers(app: FastAPI) -> None:
    """Make an application answer errors with problems."""

    @app.exception_handler(ThrowcollectError)
    async def own(_: Request, error: ThrowcollectError) -> ProblemResponse:
        return answer(error)

    @app.exception_handler(Exception)
    async def answer_unexpected(_: Request, __: Exception) -> ProblemResponse:
        # Starlette raises the error again after this answer, so that it gets into the log.
        return problem(500, "internal error", hint="the log of the server says where; please report it")

    @app.exception_handler(HTTPException)
    async def http(_: Request, error: HTTPException) -> ProblemResponse:
        return problem(error.status_code, str(error.detail), headers=dict(error.headers or {}))

    @app.exception_handler(RequestValidationError)
    async def invalid(_: Request, error: RequestValidationError) -> ProblemResponse:
        return answer(ConfigError([_describe(each) for each in error.errors()]))


def _describe(error: Mapping[str, Any]) -> Problem:
    """Describe one value of a request that FastAPI refuses; the first part of its place is ``body`` or ``query``."""
    part, *place = error["loc"]
    key = "" if error["type"] == "json_invalid" else ".".join(map(str, place))
    return Problem(error["msg"] if key else f"{part}: {error['msg']}", key=key)
