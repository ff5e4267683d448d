"""Looking for the socket of the Docker engine without importing its client."""

import subprocess
import sys
from pathlib import Path

import pytest

from throwcollect.errors import WorkerError
from throwcollect.runtimes.docker.address import check_socket, has_socket

CHOOSES = """
import sys
from throwcollect.config.schema import Config
from throwcollect.runs.runtime_choice import choose

choose(Config(), say=print, warn=print)
print(sorted({"docker", "requests", "urllib3"} & sys.modules.keys()))
"""


def test_a_missing_docker_socket_is_an_error_with_a_hint(tmp_path: Path, monkeypatch) -> None:
    monkeypatch.setenv("DOCKER_HOST", f"unix://{tmp_path}/none.sock")
    assert not has_socket()
    with pytest.raises(WorkerError, match=r"no Docker engine answers at unix:///\S+/none.sock: No such file") as caught:
        check_socket()
    assert "--runtime local" in str(caught.value)


@pytest.mark.parametrize("host", ["unix://{}", "tcp://127.0.0.1:1", "ssh://lab"])
def test_an_address_of_a_possible_engine_passes_the_check_of_the_socket(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, host: str
) -> None:
    monkeypatch.setenv("DOCKER_HOST", host.format(tmp_path))
    check_socket()


def test_the_docker_client_is_not_imported_without_an_engine(tmp_path: Path) -> None:
    done = subprocess.run(
        [sys.executable, "-c", CHOOSES],
        env={"DOCKER_HOST": f"unix://{tmp_path}/none.sock"},
        capture_output=True,
        text=True,
        check=True,
    )
    assert done.stdout.splitlines()[-1] == "[]"
