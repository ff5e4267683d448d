"""roslib, by which web pages reach ROS, in Node.js."""

from __future__ import annotations

import json
import shutil
import subprocess
from pathlib import Path

import pytest
from tests.npm import install
from tests.unit.serve.rosbridge.conftest import wait_for
from tests.unit.serve.rosbridge.robot import Robot, SetBool

HERE = Path(__file__).parent


@pytest.fixture(scope="module")
def program() -> Path:
    """The program beside roslib."""
    if shutil.which("node") is None:
        pytest.skip("there is no Node.js")
    return Path(shutil.copy(HERE / "roslib_client.mjs", install("roslib", {"roslib": "2.1.0"})))


def test_roslib_hears_speaks_calls_offers_and_sends_goals(program: Path, url: str, robot: Robot) -> None:
    found = subprocess.run(
        ["node", str(program), url], capture_output=True, text=True, check=False, timeout=60, cwd=program.parent
    )
    assert found.returncode == 0, found.stdout + found.stderr
    told = json.loads(found.stdout)
    assert told["type"] == "std_msgs/msg/String"
    assert told["nodes"] == ["/other"]
    assert told["details"][0]["type"] == "sensor_msgs/JointState"
    assert told["none"] == ["Array", [1.5]]
    assert told["cbor"] == ["Float64Array", [1.5]]
    assert told["lamp"] == {"success": True, "message": "switched"}
    assert told["nobody"] == "no node offers a service /nobody"
    assert told["feedback"] == ["a"]
    assert told["result"] == {"error_code": 0, "error_string": "done"}
    assert told["swing"] == {"error_code": 0, "error_string": "swung"}
    wait_for(lambda: robot.clock)
    assert robot.clock == [SetBool.Response(success=True, message="from roslib")]
