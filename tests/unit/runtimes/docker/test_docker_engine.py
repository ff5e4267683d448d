from pathlib import Path

import pytest
import requests
from docker.errors import APIError, DockerException
from urllib3.exceptions import ProtocolError, ReadTimeoutError

from throwcollect.errors import WorkerError
from throwcollect.runtimes.docker.docker_engine import connect, describe_error, engine_errors


def api_error(explanation: str) -> APIError:
    return APIError("500 Server Error for http+docker://localhost", requests.Response(), explanation)


@pytest.mark.parametrize(
    ("error", "words"),
    [
        (api_error("port is already allocated"), "port is already allocated"),
        (
            requests.ConnectionError(ProtocolError("Aborted.", ConnectionRefusedError(111, "Connection refused"))),
            "Connection refused",
        ),
        (DockerException("something else"), "something else"),
        (TimeoutError(), "no answer in time"),
        (requests.ReadTimeout(ReadTimeoutError(None, "/", "Read timed out. (read timeout=30)")), "no answer in time"),
        (requests.ConnectionError(ReadTimeoutError(None, "/", "Read timed out.")), "no answer in time"),
    ],
)
def test_an_error_of_the_docker_engine_is_raised_in_plain_words(error: Exception, words: str) -> None:
    assert describe_error(error) == words
    with pytest.raises(WorkerError, match=f"^sim_0: {words}$"), engine_errors("sim_0"):
        raise error


def test_connecting_without_an_engine_names_its_address_and_a_hint(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    address = f"unix://{tmp_path}/nothing.sock"
    monkeypatch.setenv("DOCKER_HOST", address)
    with pytest.raises(
        WorkerError, match=f"no Docker engine answers at {address}: No such file or directory"
    ) as caught:
        connect(timeout_s=1.0)
    assert "--runtime local" in (caught.value.hint or "")
