"""Looking for the socket of the Docker engine without importing its client."""

import hashlib
import json
import socket
from pathlib import Path

import pytest

from throwcollect.collect.runtimes.docker.address import check_socket, engine_address, has_socket
from throwcollect.collect.runtimes.docker.docker_engine import connect
from throwcollect.errors import WorkerError


def make_contexts(home: Path, current: str, **hosts: str) -> None:
    """Write the settings of the command `docker`: its current context, and the hosts of all contexts."""
    for name, host in hosts.items():
        meta = home / ".docker" / "contexts" / "meta" / hashlib.sha256(name.encode()).hexdigest()
        meta.mkdir(parents=True)
        (meta / "meta.json").write_text(json.dumps({"Name": name, "Endpoints": {"docker": {"Host": host}}}))
    (home / ".docker" / "config.json").write_text(json.dumps({"currentContext": current}))


def test_the_address_is_that_of_the_context_unless_a_variable_names_another(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    make_contexts(tmp_path, "rootless", rootless="unix:///run/user/1000/docker.sock", lab="ssh://lab")
    for name in ("DOCKER_HOST", "DOCKER_CONTEXT", "DOCKER_CONFIG"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setenv("HOME", str(tmp_path))
    assert engine_address() == "unix:///run/user/1000/docker.sock"
    monkeypatch.setenv("DOCKER_CONTEXT", "lab")
    assert engine_address() == "ssh://lab"
    monkeypatch.setenv("DOCKER_CONTEXT", "default")
    assert engine_address() == "unix:///var/run/docker.sock"
    monkeypatch.setenv("DOCKER_CONTEXT", "nowhere")
    assert not has_socket()
    with pytest.raises(
        WorkerError, match=r"^the command docker has no usable context 'nowhere'\n  try: docker context"
    ):
        check_socket()
    monkeypatch.setenv("DOCKER_HOST", "tcp://127.0.0.1:1")
    assert engine_address() == "tcp://127.0.0.1:1"


def test_the_client_connects_to_the_engine_of_the_context(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    make_contexts(tmp_path, "rootless", rootless=f"unix://{tmp_path}/none.sock")
    for name in ("DOCKER_HOST", "DOCKER_CONTEXT", "DOCKER_CONFIG"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setenv("HOME", str(tmp_path))
    with socket.socket(socket.AF_UNIX) as engine:
        engine.bind(f"{tmp_path}/none.sock")
        engine.listen()
        with pytest.raises(
            WorkerError, match=f"no Docker engine answers at unix://{tmp_path}/none.sock: no answer in time"
        ):
            connect(timeout_s=0.2)
        engine.setblocking(False)
        assert engine.accept()[0].recv(3) == b"GET"
