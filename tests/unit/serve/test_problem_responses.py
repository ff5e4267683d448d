"""Errors become problem responses of the server."""

import json

import pytest

from throwcollect.errors import (
    ConfigError,
    ConflictError,
    DatasetError,
    NotFoundError,
    ThrowcollectError,
    WorkerError,
)
from throwcollect.extras import MissingExtraError
from throwcollect.serve.problem_responses import answer


@pytest.mark.parametrize(
    ("error", "status"),
    [
        (NotFoundError("x"), 404),
        (ConflictError("x"), 409),
        (ConfigError("x"), 422),
        (MissingExtraError("plotly"), 503),
        (WorkerError("x"), 503),
        (DatasetError("x"), 409),
        (ThrowcollectError("x"), 500),
    ],
)
def test_each_kind_of_error_has_a_status(error: ThrowcollectError, status: int) -> None:
    response = answer(error)
    assert response.status_code == status
    assert response.media_type == "application/problem+json"
    assert json.loads(response.body)["status"] == status
