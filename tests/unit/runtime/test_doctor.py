import json
import socketserver
import threading
from http.server import BaseHTTPRequestHandler
from pathlib import Path

import pytest

from throwcollect.runtime.doctor import examine
from throwcollect.runtime.image import SOURCES_LABEL, default_tag


def test_a_machine_that_runs_the_tests_has_no_problem(tmp_path: Path) -> None:
    checks = {check.name: check for check in examine(tmp_path)}
    assert list(checks) == ["python", "cores", "memory", "pybullet", "robot", "docker", "ports", "disk"]
    assert [check for check in checks.values() if check.status == "problem"] == []
    assert str(tmp_path) in checks["disk"].finding


class Engine(BaseHTTPRequestHandler):
    """As much of a Docker engine as says its version, and whether it has an image."""

    images: tuple[str, ...] = ()
    sources = "unknown"

    def do_GET(self) -> None:
        path = self.path.removeprefix("/v1.41")
        if path == "/version":
            self.answer(200, {"Version": "27.1", "ApiVersion": "1.41"})
        elif path in [f"/images/{image}/json" for image in self.images]:
            self.answer(200, {"Id": "sha256:0", "Config": {"Labels": {SOURCES_LABEL: self.sources}}})
        else:
            self.answer(404, {"message": f"No such image: {path}"})

    def answer(self, code: int, document: dict[str, object]) -> None:
        body = json.dumps(document).encode()
        self.send_response(code)
        self.send_header("Content-Length", str(len(body)))
        self.end_headers()
        self.wfile.write(body)

    def address_string(self) -> str:
        return "client"

    def log_message(self, *_: object) -> None:
        pass


def test_a_docker_engine_and_its_image_are_found(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "docker.sock"
    monkeypatch.setenv("DOCKER_HOST", f"unix://{path}")

    def found() -> tuple[str, str]:
        check = {check.name: check for check in examine(tmp_path)}["docker"]
        return check.status, check.finding

    assert found() == (
        "note",
        f"no Docker engine answers at unix://{path}: No such file or directory; runs use processes",
    )
    with socketserver.ThreadingUnixStreamServer(str(path), Engine) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        lacking = f"the image {default_tag()} is not there yet; throwcollect image build makes it"
        assert found() == ("note", f"Docker 27.1 answers at unix://{path}; {lacking}")
        monkeypatch.setattr(Engine, "images", (default_tag(),))
        assert found() == ("ok", f"Docker 27.1 answers at unix://{path}, with the image {default_tag()}")
        monkeypatch.setattr(Engine, "sources", "0" * 64)
        outdated = f"the image {default_tag()} was made from other sources than these"
        status, finding = found()
        assert (status, finding.partition("; ")[2]) == (
            "note",
            f"{outdated}; throwcollect image build makes it anew",
        )
        server.shutdown()


@pytest.mark.parametrize(("installed", "status"), [(True, "note"), (False, "problem")])
def test_another_python_is_a_problem_only_where_pybullet_is_missing(
    installed: bool, status: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("sys.version_info", (3, 12, 3))
    monkeypatch.setattr("throwcollect.runtime.doctor.find_spec", lambda _: object() if installed else None)
    (python,) = [check for check in examine(tmp_path) if check.name == "python"]
    assert (python.status, python.finding) == (status, "3.12.3; pybullet has wheels for 3.10 and 3.11")
