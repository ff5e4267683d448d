"""The libraries by which Lichtblick and Foxglove speak rosbridge, used as their player does, in Node.js."""

from __future__ import annotations

import json
import shutil
import subprocess
from pathlib import Path

import pytest
from tests.npm import install
from tests.unit.serve.rosbridge.conftest import wait_for
from tests.unit.serve.rosbridge.robot import Robot

HERE = Path(__file__).parent
PACKAGES = {
    "@foxglove/roslibjs": "0.0.3",
    "@lichtblick/rosmsg": "1.0.0",
    "@lichtblick/rosmsg2-serialization": "1.0.0",
    # The package above needs this one, but lists it only as a development dependency.
    "@lichtblick/cdr": "1.0.1",
}


@pytest.fixture(scope="module")
def program() -> Path:
    """The program beside the libraries."""
    if shutil.which("node") is None:
        pytest.skip("there is no Node.js")
    # Lichtblick runs in a browser and uses its WebSocket, which Node.js must have here.
    has_sockets = subprocess.run(["node", "--experimental-websocket", "-e", ""], capture_output=True, check=False)
    if has_sockets.returncode:
        pytest.skip("Node.js has no WebSocket; it has one from 20.10 on")
    return Path(shutil.copy(HERE / "lichtblick_client.mjs", install("lichtblick", PACKAGES)))


def test_lichtblick_hears_publishes_calls_and_draws_the_graph(program: Path, url: str, robot: Robot) -> None:
    found = subprocess.run(
        ["node", "--experimental-websocket", str(program), url],
        capture_output=True,
        text=True,
        check=False,
        timeout=60,
        cwd=program.parent,
    )
    assert found.returncode == 0, found.stdout + found.stderr
    told = json.loads(found.stdout)
    assert told["isRos2"]
    assert told["types"] == {
        "/words": "std_msgs/msg/String",
        "/states": "sensor_msgs/msg/JointState",
        "/rosout": "rcl_interfaces/msg/Log",
    }
    assert told["words"] == "hello"
    stamp = {"sec": 0, "nsec": 0}
    assert told["states"] == {"name": ["a"], "position": ["Float64Array", 1.5], "velocity": 0, "stamp": stamp}
    assert {"/words", "/states"} <= set(told["graph"]["/other"]["publications"])
    assert "/orders" in told["graph"]["/other"]["subscriptions"]
    assert "/lamp" in told["graph"]["/other"]["services"]
    assert told["lamp"] == ["std_srvs/srv/SetBool", {"success": True, "message": "switched"}]
    wait_for(lambda: robot.orders)
    assert robot.orders == ["from Lichtblick"]
