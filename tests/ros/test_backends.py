"""Simulations on genuine rclpy and on the embedded backend, with clients on either."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from throwcollect.ros.middleware import EMBEDDED_RMW, RMW_VARIABLE

ROOT = Path(__file__).parents[2]

# Genuine and embedded nodes meet over Zenoh alone; with another RMW, there are no such cases.
MIXED = [("rclpy", "embedded"), ("embedded", "rclpy")] if os.environ.get(RMW_VARIABLE) == EMBEDDED_RMW else []

# On Fast DDS those that tell most: the acceptance cases of the controllers, and trials. Others lean on an order of
# messages from different publishers that DDS does not promise.
TOLD = [f"tests/integration/test_{name}.py" for name in ("controllers", "trajectories", "leases", "play_motion")]


@pytest.mark.parametrize(("client", "simulation"), [*MIXED, ("rclpy", "rclpy")])
def test_a_simulation_behaves_alike_whatever_backend_it_and_its_client_are_on(client, simulation, tmp_path):
    """The integration tests, with the client and the simulation each on a given backend.

    What fails is run once more: nodes on Fast DDS at times do not find each other, in which case a run would start them
    again, and genuine clients of rmw_zenoh_cpp that are made anew again and again are at times left without an answer.
    """

    tests = ["tests/integration"] if MIXED else TOLD

    def run(*options: str) -> subprocess.CompletedProcess[str]:
        return subprocess.run(
            [
                sys.executable,
                "-m",
                "pytest",
                "-q",
                "-o",
                f"cache_dir={tmp_path}",
                *options,
                *tests,
            ],
            cwd=ROOT,
            env={**os.environ, "THROWCOLLECT_ROS": client, "SIMULATION_ROS": simulation},
            capture_output=True,
            text=True,
            timeout=900,
            check=False,
        )

    found = run()
    if found.returncode:
        found = run("--last-failed")
    assert found.returncode == 0, found.stdout[-6000:] + found.stderr[-2000:]
