import socket
import threading
from pathlib import Path

import pytest

from throwcollect.runtime.doctor import examine


def test_a_machine_that_runs_the_tests_has_no_problem(tmp_path: Path) -> None:
    checks = {check.name: check for check in examine(tmp_path)}
    assert list(checks) == ["python", "cores", "memory", "pybullet", "robot", "docker", "ports", "disk"]
    assert [check for check in checks.values() if check.status == "problem"] == []
    assert str(tmp_path) in checks["disk"].finding


def test_a_docker_engine_is_found_by_its_socket(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "docker.sock"
    monkeypatch.setenv("DOCKER_HOST", f"unix://{path}")

    def found() -> tuple[str, str]:
        check = {check.name: check for check in examine(tmp_path)}["docker"]
        return check.status, check.finding

    assert found() == ("note", f"no engine answers at {path} (No such file or directory); runs use processes")
    with socket.socket(socket.AF_UNIX) as engine:
        engine.bind(str(path))
        engine.listen()

        def answer() -> None:
            connection, _ = engine.accept()
            with connection:
                connection.recv(4096)
                connection.sendall(b"HTTP/1.1 200 OK\r\nServer: Docker/27\r\nContent-Length: 0\r\n\r\n")

        thread = threading.Thread(target=answer)
        thread.start()
        assert found() == ("ok", f"Docker/27 answers at {path}")
        thread.join()
