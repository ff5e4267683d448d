"""`throwcollect serve` with real processes: its instances, their watchers, and servers that are killed."""

from __future__ import annotations

import json
import os
import signal
import socket
import ssl
import subprocess
import time
from collections.abc import Iterator
from contextlib import closing, suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import httpx
import numpy as np
import psutil
import pytest
from websockets.exceptions import ConnectionClosed
from websockets.sync.client import ClientConnection, connect

from tests.commands import start_command
from tests.e2e.collection import FAST, call_here, collect_here, fingerprints, write_config
from tests.e2e.page import wait_for
from throwcollect import ros
from throwcollect.collect.runs.records import Records
from throwcollect.ros.srv import GetParameters
from throwcollect.run_key import RunKey
from throwcollect.serve.finding import find_server, make_page_address
from throwcollect.serve.rosbridge.codec import LONGEST_FRAME
from throwcollect.state_directory import STATE_VARIABLE

pytestmark = pytest.mark.e2e
TRIALS, MANY = 10, 12
NO_AUTHORITIES = ssl.SSLContext(ssl.PROTOCOL_TLS_CLIENT)
"""Requests do not use TLS; without this context, each of them would read all certificate authorities, for 30 ms."""
SLOWLY = {"sim.real_time_factor": 1}
CATALOGUE = """\
components:
  throws: {config: small.yaml, max_instances: 2}
  talos: {session: small.yaml}
"""


@dataclass
class Server:
    """A server, and how programs find it."""

    process: psutil.Process
    address: dict[str, Any]

    def ask(self, method: str, path: str, content: Any = None) -> tuple[int, Any]:
        answer = httpx.request(
            method,
            f"{self.address['url']}/api/v1{path}",
            json=content,
            headers={"Authorization": f"Bearer {self.address['token']}"},
            timeout=60,
            verify=NO_AUTHORITIES,
        )
        return answer.status_code, answer.json() if answer.content else None

    def open(self, path: str) -> ClientConnection:
        return self._connect(f"/api/v1{path}")

    def open_rosbridge(self, instance: str) -> ClientConnection:
        return self._connect(f"/rosbridge/{instance}")

    def _connect(self, path: str) -> ClientConnection:
        url = self.address["url"].replace("http", "ws", 1) + path
        protocol: Any = f"bearer.{self.address['token']}"
        return connect(url, subprotocols=[protocol], open_timeout=60, max_size=None)

    def instance(self, name: str) -> dict[str, Any]:
        status, found = self.ask("GET", f"/instances/{name}")
        assert status == 200, found
        return dict(found)

    def wait_until(self, name: str, status: str) -> dict[str, Any]:
        try:
            return dict(wait_for(lambda: found if (found := self.instance(name))["status"] == status else None))
        except AssertionError as error:
            raise AssertionError(f"not {status}: {self.instance(name)}") from error

    def kill(self) -> None:
        with suppress(psutil.NoSuchProcess):
            self.process.kill()
            self.process.wait()


@dataclass
class Place:
    """A directory with a catalogue, and the state of a user."""

    directory: Path
    state: Path
    servers: list[Server] = field(default_factory=list)

    def serve(self, *options: str) -> Server:
        """A server of its own."""
        words = ("serve", "catalogue.yaml", "--port", "0", "--json", *options)
        process = start_command(*words, cwd=self.directory, stderr=subprocess.DEVNULL)
        assert process.stdout is not None
        line = process.stdout.readline()
        assert line, "no server starts"
        url = json.loads(line)["url"]
        found = wait_for(lambda: self.address() if self.address()["url"] == url else None) if not options else {}
        self.servers.append(Server(psutil.Process(process.pid), found or {"url": url}))
        return self.servers[-1]

    def address(self) -> dict[str, Any]:
        path = self.state / "serve.json"
        return dict(json.loads(path.read_text())) if path.exists() else {"url": None}


@pytest.fixture(scope="module")
def place(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Place]:
    directory = tmp_path_factory.mktemp("served")
    write_config(directory, trials=TRIALS, sim=FAST)
    (directory / "catalogue.yaml").write_text(CATALOGUE)
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv(STATE_VARIABLE, str(directory / "state"))
        patch.setenv("DOCKER_HOST", f"unix://{directory}/none.sock")
        place = Place(directory, directory / "state")
        yield place
        for server in place.servers:
            server.kill()
        for run in Records().all():
            if run.lives:
                os.kill(run.record.launcher, signal.SIGKILL)


@pytest.fixture(scope="module")
def first(place: Place) -> Iterator[Server]:
    server = place.serve()
    yield server
    if server.process.is_running():
        server.kill()


@pytest.fixture
def server(place: Place, first: Server) -> Iterator[Server]:
    """A server; a new one if a test has killed that before."""
    if first.process.is_running():
        yield first
    else:
        again = place.serve()
        yield again
        again.kill()


def iter_until_cut(state: ClientConnection) -> Iterator[dict[str, Any]]:
    with suppress(ConnectionClosed):
        while True:
            yield json.loads(state.recv(timeout=60))


def never_read(server: Server, path: str) -> socket.socket:
    """A client that asks for a socket and reads nothing of what comes."""
    host, port = server.address["url"].removeprefix("http://").split(":")
    client = socket.create_connection((host, int(port)))
    client.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 1024)
    client.sendall(
        f"GET /api/v1{path}?token={server.address['token']} HTTP/1.1\r\nHost: {host}:{port}\r\nConnection: Upgrade\r\n"
        "Upgrade: websocket\r\nSec-WebSocket-Version: 13\r\n"
        "Sec-WebSocket-Key: AAAAAAAAAAAAAAAAAAAAAA==\r\n\r\n".encode()
    )
    return client


def test_a_watched_run_outlives_its_server_and_can_be_stopped_and_resumed(
    place: Place, first: Server, tmp_path: Path
) -> None:
    # Enough to go on for as long as a server takes to start on a busy machine.
    wish = {"component": "throws", "simulations": 1, "set": {**SLOWLY, "trials": MANY}}
    assert first.ask("PUT", "/instances/watched", wish)[0] == 202
    assert first.ask("PUT", "/instances/watched", wish)[0] == 200
    first.wait_until("watched", "running")
    with (
        closing(never_read(first, "/state")),
        closing(never_read(first, "/instances/watched/shown")),
        first.open("/state") as state,
        first.open("/instances/watched/shown") as shown,
    ):
        assert json.loads(state.recv())["instances"][0]["id"] == "watched"
        frame = shown.recv(timeout=60)
        assert isinstance(frame, bytes)
        header = json.loads(frame[4 : 4 + int.from_bytes(frame[:4], "little")])
        numbers = header["samples"] * (len(header["joints"]) + 3 + 7)
        assert {"trial", "outcome", "joints", "samples", "rate_hz", "landing"} <= set(header)
        assert len(frame) % 4 == 0
        assert 0 <= len(frame) - 4 * numbers - 4 - len(json.dumps(header)) < 4
        before = first.instance("watched")
        first.kill()
        # The end of the server has cut the socket, so the iteration ends.
        assert list(iter_until_cut(state))[-1]["version"] == 1
    second = place.serve()
    after = second.instance("watched")
    growing = ("progress", "nodes")
    assert {k: v for k, v in after.items() if k not in growing} == {k: v for k, v in before.items() if k not in growing}
    assert [node["handle"] for node in after["nodes"]] == [node["handle"] for node in before["nodes"]]
    assert second.ask("GET", "/collections/watched/files")[0] == 409
    assert second.ask("POST", "/collections/watched/resume")[0] == 409
    assert second.ask("DELETE", "/instances/watched")[0] == 202
    wait_for(lambda: (found := second.instance("watched"))["stopping"] or found["status"] == "ended")
    # A second request does not end the running trials at once.
    assert second.ask("DELETE", "/instances/watched")[0] in (202, 409)
    assert second.wait_until("watched", "ended")["exit_code"] == 130
    status, resumed = second.ask("POST", "/collections/watched/resume")
    assert status == 202
    with second.open(f"/instances/{resumed['id']}/shown"):
        assert second.wait_until(resumed["id"], "ended")["exit_code"] == 0
    second.kill()
    collect_here(write_config(tmp_path, trials=MANY, sim=FAST), tmp_path / "data", "--set", "sim.real_time_factor=1")
    assert fingerprints(place.directory / "datasets" / "watched") == fingerprints(tmp_path / "data")


def read_factor(name: str) -> float:
    """What a simulation of a run answers by a service."""
    run = Records().get(name)
    context = ros.Context()
    ros.init(context=context, connection=run.connection)
    try:
        node = ros.Node("_asks", context=context)
        executor = ros.SingleThreadedExecutor(context=context)
        executor.add_node(node)
        client = node.create_client(GetParameters, "/sim_0/sim_0/get_parameters")
        assert client.wait_for_service(30)
        future = client.call_async(GetParameters.Request(names=["sim.real_time_factor"]))
        executor.spin_until_future_complete(future, timeout_sec=20)
        return float(future.result().values[0].double_value)
    finally:
        ros.shutdown(context=context)


def test_a_session_runs_in_real_time_as_long_as_a_client_watches(place: Place, server: Server) -> None:
    faster = {"component": "talos", "simulations": 1, "set": {"sim.real_time_factor": 4}}
    assert server.ask("PUT", "/instances/talos", faster)[0] == 202
    assert server.ask("PUT", "/instances/other", {"component": "talos"})[0] == 409
    begun = server.wait_until("talos", "running")
    assert (begun["kind"], begun["robots"], begun["dataset"]) == ("session", ["sim_0"], None)
    assert read_factor("talos") == 4.0
    with server.open("/instances/talos/live/sim_0"):
        with server.open("/instances/talos/live/sim_0"):
            assert read_factor("talos") == 1.0
        time.sleep(1.0)
        assert read_factor("talos") == 1.0
    wait_for(lambda: read_factor("talos") == 4.0)
    with server.open("/instances/talos/live/sim_1") as nobody, pytest.raises(ConnectionClosed) as end:
        nobody.recv()
    assert (end.value.rcvd and end.value.rcvd.code) == 4404
    longest = '{"op": "nothing", "pad": "' + "x" * (LONGEST_FRAME - 28) + '"}'
    with server.open_rosbridge("talos") as client:
        client.send(longest)
        assert "Input tag 'nothing'" in json.loads(client.recv(60))["msg"]
        # The server stops reading a frame that is too long, so the client may see a reset in place of code 1009.
        with suppress(ConnectionClosed):
            client.send(longest + " ")
        with pytest.raises(ConnectionClosed):
            client.recv(60)
    with server.open("/instances/talos/live/sim_0"):
        server.kill()
        # The next server restores the speed that a killed one has slowed down.
        assert read_factor("talos") == 1.0
        again = place.serve()
        wait_for(lambda: read_factor("talos") == 4.0)
    assert again.ask("DELETE", "/instances/talos")[0] == 202
    assert again.wait_until("talos", "ended")["exit_code"] == 0
    again.kill()


def test_sensors_of_a_session_are_added_changed_and_removed(server: Server) -> None:
    assert server.ask("PUT", "/instances/seen", {"component": "talos", "simulations": 1})[0] == 202
    server.wait_until("seen", "running")
    path = "/instances/seen/simulations/sim_0/sensors"
    assert server.ask("GET", path) == (200, [])
    camera = {"kind": "camera", "link": "head_2_link", "width": 32, "height": 24, "rate_hz": 50, "rpy_rad": [0, 0.5, 0]}
    status, added = server.ask("PUT", f"{path}/eye", camera)
    assert (status, added["streams"], added["section"]["far_m"]) == (200, ["color"], 20)
    assert server.ask("GET", path) == (200, [added])
    with server.open_rosbridge("seen") as client:

        def see_info(focal: float) -> None:
            while (info := json.loads(client.recv(60))["msg"])["k"][0] != pytest.approx(focal):
                pass
            assert info["width"] == 32

        topic = {"topic": "/sim_0/eye/camera_info", "type": "sensor_msgs/msg/CameraInfo"}
        client.send(json.dumps({"op": "subscribe", **topic}))
        see_info(12 / np.tan(1.05 / 2))
        status, changed = server.ask("PATCH", f"{path}/eye", {"vertical_fov_rad": 0.5, "noise": {"dropout": 0.1}})
        assert (status, changed["section"]["noise"]["dropout"], changed["section"]["width"]) == (200, 0.1, 32)
        see_info(12 / np.tan(0.25))
        # Who sets a single parameter sees it in what the sensors are.
        value = {"type": 3, "double_value": 0.6}
        one = {"parameters": [{"name": "sensors.eye.vertical_fov_rad", "value": value}]}
        service = {"service": "/sim_0/sensors/set_parameters", "type": "rcl_interfaces/srv/SetParameters"}
        client.send(json.dumps({"op": "call_service", **service, "args": one}))
        wait_for(lambda: server.ask("GET", path)[1][0]["section"]["vertical_fov_rad"] == 0.6)
    for method, name, section, key in (
        ("PUT", "eye", {**camera, "width": 1}, "sensors.eye.width"),
        ("PUT", "eye", {**camera, "link": "nose"}, "sensors.eye.link"),
        ("PUT", "eye", {"width": 8}, "sensors.eye.kind"),
        ("PUT", "ball", camera, "sensors.ball"),
        ("PUT", "E", camera, "sensors.E"),
        ("PATCH", "eye", {"with": 9}, "sensors.eye.with"),
        ("PATCH", "eye", {"rate_hz": 11}, "sensors.eye.rate_hz"),
    ):
        status, refused = server.ask(method, f"{path}/{name}", section)
        assert (status, [each["key"] for each in refused["problems"]]) == (422, [key]), refused
    for method, where in (("PATCH", f"{path}/nose"), ("DELETE", f"{path}/nose"), ("GET", path.replace("_0", "_7"))):
        assert server.ask(method, where, {} if method == "PATCH" else None)[0] == 404
    assert server.ask("DELETE", f"{path}/eye") == (204, None)
    assert server.ask("GET", path) == (200, [])
    assert server.ask("DELETE", "/instances/seen")[0] == 202
    assert server.wait_until("seen", "ended")["exit_code"] == 0
    assert server.ask("GET", path)[0] == 409


def test_a_terminated_server_ends_despite_connected_listeners(server: Server, place: Place) -> None:
    other = place.serve("--datasets", "elsewhere")
    assert place.address()["url"] == server.address["url"]
    with server.open("/state") as state, closing(never_read(server, "/state")):
        state.recv()
        server.process.terminate()
        server.process.wait(timeout=30)
        with pytest.raises(ConnectionClosed):
            state.recv(timeout=30)
    other.kill()


def test_view_starts_only_one_server(place: Place, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(place.directory)
    pids = set()
    try:
        for _ in range(2):
            said = call_here("view", "--json")
            assert said.returncode == 0, said.stderr
            address = place.address()
            pids.add(address["pid"])
            assert json.loads(said.stdout)["page"].startswith(f"{address['url']}/#code=")
            code = json.loads(said.stdout)["page"].rpartition("=")[2]
            # Other users may be allowed to read the log.
            assert code not in (place.state / "serve.log").read_text()
        said = call_here("up", "--view", "--runtime", "inprocess", "--trials", "1", "small.yaml", "--output", "seen")
        assert f"look inside: {address['url']}/#code=" in said.stderr
        port = address["url"].rpartition(":")[2]
        assert f"from another machine: ssh -L {port}:127.0.0.1:{port} " in said.stderr
        assert len(pids) == 1
    finally:
        psutil.Process(place.address()["pid"]).kill()


def test_a_server_speaks_ipv6_and_tls(place: Place, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    key = RunKey(tmp_path / "key")
    key.create()
    monkeypatch.setenv(STATE_VARIABLE, str(tmp_path / "state"))
    words = ("serve", "--host", "::1", "--port", "0", "--json")
    options = ("--tls-cert", str(key.certificate), "--tls-key", str(key.private_key))
    tokens = tmp_path / "tokens"
    with start_command(*words, *options, "--token-file", str(tokens), cwd=tmp_path, stderr=None) as process:
        assert process.stdout is not None
        url = json.loads(process.stdout.readline())["url"]
        assert url.startswith("https://[::1]:")
        found = find_server()
        assert found is not None
        assert found.url == url
        assert tokens.read_text().split() == [found.token, found.read_only_token]
        assert make_page_address(found).startswith(f"{url}/#code=")
        process.terminate()
        assert process.wait(timeout=30) == 0
    assert find_server() is None
