import json
import socketserver
import threading
from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from http.server import BaseHTTPRequestHandler
from importlib.metadata import EntryPoint, EntryPoints, version
from pathlib import Path
from unittest.mock import Mock

import pytest

from throwcollect import members
from throwcollect.build import build_digest
from throwcollect.members import names_of
from throwcollect.robots.talos import TALOS
from throwcollect.ros.middleware import VARIABLE, _choose_installed
from throwcollect.runs.doctor import examine
from throwcollect.runtimes.docker.docker_engine import default_tag
from throwcollect.runtimes.image_sources import SOURCES_LABEL

PLUGINS = Path(__file__).parents[2] / "plugins"


def test_doctor_finds_no_problem_on_a_machine_that_runs_the_tests(tmp_path: Path) -> None:
    checks = {check.name: check for check in examine(tmp_path)}
    assert list(checks) == [
        "python",
        "extras",
        "cores",
        "memory",
        "pybullet",
        "mujoco",
        "robot",
        *(f"robot {name}" for name in names_of("robots")[1:]),
        "rclpy",
        "embedded",
        "docker",
        "state",
        "disk",
    ]
    assert [check for check in checks.values() if check.status == "problem"] == []
    assert str(tmp_path) in checks["disk"].finding
    # Two machines whose builds differ cannot simulate for one run.
    for package, engine in (("pybullet", "bullet"), ("mujoco", "mujoco")):
        assert f", build {build_digest(engine)[:10]}" in checks[package].finding


def test_doctor_lists_installed_and_missing_extras(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("throwcollect.runs.doctor.is_installed", lambda package: package != "onnx")
    monkeypatch.setattr("throwcollect.runs.doctor.has_wheel", lambda _: True)
    (finding,) = (check.finding for check in examine(tmp_path) if check.name == "extras")
    there = "collect, docker, export, gym, mujoco, pandas, report, serve, video"
    assert finding == f"{there}, without onnx (try: pip install 'throwcollect[onnx]')"


def lack_disk() -> Path:
    raise OSError("the disk is gone")


LOST_ARM = replace(TALOS, name="lost", share=lack_disk)


@pytest.fixture
def install(monkeypatch: pytest.MonkeyPatch) -> Iterator[Callable[[str, Mapping[str, str]], None]]:
    """Adds members of another package to a family, by name, until the test ends."""
    points: dict[str, EntryPoints] = {}
    caches = (members._find_members, members.find_broken)

    def install(family: str, places: Mapping[str, str]) -> None:
        group = f"throwcollect.{family}"
        points[group] = EntryPoints(EntryPoint(name, place, group) for name, place in places.items())
        for cached in caches:
            cached.cache_clear()

    def select(group: str) -> EntryPoints:
        return points.get(group, EntryPoints())

    monkeypatch.setattr(members, "entry_points", lambda group=None: select(group) if group else Mock(select=select))
    yield install
    monkeypatch.undo()
    for cached in caches:
        cached.cache_clear()


def test_doctor_examines_robots_of_other_packages_and_notes_failures(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, install: Callable[[str, Mapping[str, str]], None]
) -> None:
    monkeypatch.syspath_prepend(PLUGINS)
    places = {"planar_arm": "planar_arm.robot:PLANAR_ARM", "absent": "not_there:ARM", "lost": f"{__name__}:LOST_ARM"}
    install("robots", places)
    checks = {check.name: check for check in examine(tmp_path)}
    found = {name: (checks[f"robot {name}"].status, checks[f"robot {name}"].finding) for name in places}
    assert found["planar_arm"] == ("ok", f"the planar arm, {PLUGINS / 'planar_arm' / 'planar_arm.urdf'}")
    assert found["absent"][0] == found["lost"][0] == "note"
    assert "the robot absent of an unknown package cannot be loaded: ModuleNotFoundError" in found["absent"][1]
    assert "the robot lost of an unknown package cannot find its files: OSError: the disk" in found["lost"][1]
    assert (checks["robot"].status, checks["robot"].finding.partition(" of ")[0]) == ("ok", "Talos")


def backends(directory: Path) -> dict[str, tuple[str, str]]:
    _choose_installed.cache_clear()
    found = {check.name: (check.status, check.finding) for check in examine(directory)}
    _choose_installed.cache_clear()
    return {name: found[name] for name in ("rclpy", "embedded")}


def test_doctor_reports_both_backends_and_their_missing_parts(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    zenoh = f"Zenoh {version('eclipse-zenoh')}"
    monkeypatch.delenv(VARIABLE, raising=False)
    monkeypatch.setattr("throwcollect.ros_installation.rmws", lambda: ["rmw_fastrtps_cpp"])
    monkeypatch.setattr("throwcollect.ros_installation.rclpy_version", lambda: "7.1.6")
    monkeypatch.setattr("throwcollect.ros_installation.HOW_TO_INSTALL", "pip install it")
    monkeypatch.setattr("throwcollect.ros_installation.missing", lambda: ["rclpy"])
    assert backends(tmp_path)["rclpy"] == ("note", "not installed; to have it: pip install it")
    monkeypatch.setattr("throwcollect.ros_installation.missing", lambda: ["tf2_msgs"])
    finding = "7.1.6 with rmw_fastrtps_cpp, without tf2_msgs; try: pip install it"
    assert backends(tmp_path)["rclpy"] == ("note", finding)
    monkeypatch.setattr("throwcollect.ros_installation.missing", list)
    assert backends(tmp_path)["rclpy"] == ("ok", "7.1.6 with rmw_fastrtps_cpp and all interfaces")
    monkeypatch.setenv(VARIABLE, "embedded")
    finding = f"{zenoh}; nodes run on the embedded backend, as THROWCOLLECT_ROS is embedded"
    assert backends(tmp_path)["embedded"] == ("ok", finding)


def test_doctor_reports_a_backend_that_nodes_cannot_run_on_as_a_problem(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv(VARIABLE, "rclpy")
    monkeypatch.setattr("throwcollect.ros.middleware.missing", lambda: ["tf2_msgs"])
    status, finding = backends(tmp_path)["embedded"]
    assert status == "problem"
    assert "; THROWCOLLECT_ROS is rclpy, but Python does not find tf2_msgs; try: " in finding


class Engine(BaseHTTPRequestHandler):
    """A fake Docker engine that answers only what its version is and whether it has an image."""

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


def test_doctor_reports_the_docker_engine_and_its_image(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "docker.sock"
    monkeypatch.setenv("DOCKER_HOST", f"unix://{path}")

    def check_docker() -> tuple[str, str]:
        check = {check.name: check for check in examine(tmp_path)}["docker"]
        return check.status, check.finding

    assert check_docker() == (
        "note",
        f"no Docker engine answers at unix://{path}: No such file or directory; runs use processes",
    )
    with socketserver.ThreadingUnixStreamServer(str(path), Engine) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        lacking = f"the image {default_tag()} is not there yet; make image, in a clone, builds it"
        assert check_docker() == ("note", f"Docker 27.1 answers at unix://{path}; {lacking}")
        monkeypatch.setattr(Engine, "images", (default_tag(),))
        assert check_docker() == ("ok", f"Docker 27.1 answers at unix://{path}, with the image {default_tag()}")
        monkeypatch.setattr(Engine, "sources", "0" * 64)
        outdated = f"the image {default_tag()} was made from other sources than these"
        status, finding = check_docker()
        assert (status, finding.partition("; ")[2]) == (
            "note",
            f"{outdated}; make image builds it anew",
        )
        server.shutdown()
