import pytest
import requests
from docker.errors import APIError

from throwcollect.collect.runtimes.docker.docker_engine import describe_error, engine_errors
from throwcollect.errors import WorkerError


def api_error(explanation: str) -> APIError:
    return APIError("500 Server Error for http+docker://localhost", requests.Response(), explanation)


@pytest.mark.parametrize(
    ("error", "words"),
    [
        (api_error("port is already allocated"), "port is already allocated"),
        (TimeoutError(), "no answer in time"),
    ],
)
def test_an_error_of_the_docker_engine_is_raised_in_plain_words(error: Exception, words: str) -> None:
    assert describe_error(error) == words
    with pytest.raises(WorkerError, match=f"^sim_0: {words}$"), engine_errors("sim_0"):
        raise error
