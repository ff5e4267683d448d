"""Errors as answers: a status, and all facts as `application/problem+json` (RFC 9457)."""

from __future__ import annotations

from http import HTTPStatus
from typing import Any, get_origin

from fastapi import FastAPI, Request
from fastapi.exceptions import RequestValidationError
from fastapi.responses import JSONResponse
from fastapi.routing import APIRoute
from pydantic import BaseModel, ValidationError, create_model
from starlette.exceptions import HTTPException

from throwcollect.config.problems import findings
from throwcollect.config.shape import ValueShape
from throwcollect.errors import (
    ConfigError,
    ConflictError,
    DatasetError,
    NotFoundError,
    Problem,
    ThrowcollectError,
    WorkerError,
)
from throwcollect.extras import MissingExtraError, MissingLibraryError

_STATUS: tuple[tuple[type[ThrowcollectError], int], ...] = (
    (NotFoundError, 404),
    (ConflictError, 409),
    (ConfigError, 422),
    (DatasetError, 409),
    (MissingExtraError, 503),
    (MissingLibraryError, 503),
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
    async def invalid(request: Request, error: RequestValidationError) -> ProblemResponse:
        found = _find_problems_of_body(request, error) or _find_problems_of_query(request)
        return answer(ConfigError(found or [Problem("the request is not as it should be")]))


def _find_problems_of_body(request: Request, error: RequestValidationError) -> list[Problem]:
    """Put into words what is wrong with the body of a request; empty if the error is not in the body."""
    wrong = next((each for each in error.errors() if each["loc"][0] == "body"), None)
    model = _find_model_of_body(request)
    if wrong is None or model is None:
        return []
    if wrong["type"] == "json_invalid":
        return [Problem(f"the body is not valid JSON: {wrong['ctx']['error']}")]
    if isinstance(error.body, bytes):
        return [Problem("the body should be JSON, and the header Content-Type should be application/json")]
    return _find_problems(model, error.body, "the body ")


def _find_problems_of_query(request: Request) -> list[Problem]:
    """Put into words what is wrong with the parameters of a request."""
    parameters = request.scope["route"].dependant.query_params
    fields: dict[str, Any] = {each.name: (each.field_info.annotation, each.field_info) for each in parameters}
    model = create_model("Query", **fields)
    given = request.query_params
    values = {
        each.name: given.getlist(each.name) if get_origin(each.field_info.annotation) is list else given[each.name]
        for each in parameters
        if each.name in given
    }
    return _find_problems(model, values, "the query ")


def _find_problems(model: type[BaseModel], values: object, what: str) -> list[Problem]:
    """Find values that do not fit a model; `what` begins the sentence if the values are wrong as a whole."""
    try:
        model.model_validate(values)
    except ValidationError as found:
        schema = model.model_json_schema()
        shape = ValueShape(_resolve(schema, schema.get("$defs", {})))
        return [
            Problem(each.sentence if each.key else f"{what}{each.sentence}", key=each.key)
            for each in findings(found, values, shape=shape, page="docs/serve.md")
        ]
    return []


def _resolve(node: Any, definitions: dict[str, Any]) -> Any:
    """Replace references by the definitions that they name, because a shape resolves only those of configurations."""
    if isinstance(node, list):
        return [_resolve(each, definitions) for each in node]
    if not isinstance(node, dict):
        return node
    if "$ref" in node:
        node = definitions[node["$ref"].rpartition("/")[2]]
    return {key: _resolve(value, definitions) for key, value in node.items() if key != "$defs"}


def _find_model_of_body(request: Request) -> type[BaseModel] | None:
    """The model that the body of a request should fit; None if its route has none."""
    route = request.scope.get("route")
    field = route.body_field if isinstance(route, APIRoute) else None
    model = None if field is None else field.field_info.annotation
    return model if isinstance(model, type) and issubclass(model, BaseModel) else None
