"""Simulations on genuine rclpy and on the embedded backend, with clients on either."""

import os
import subprocess
import sys
import warnings
from pathlib import Path

import pytest

from throwcollect.ros.middleware import EMBEDDED_RMW, RMW_VARIABLE

ROOT = Path(__file__).parents[2]

# Genuine and embedded nodes meet only over Zenoh, so another RMW has no mixed cases.
MIXED = [("rclpy", "embedded"), ("embedded", "rclpy")] if os.environ.get(RMW_VARIABLE) == EMBEDDED_RMW else []

# On Fast DDS those that tell most: actions of the controllers, and trials. Others lean on an order of messages from
# different publishers that DDS does not promise.
TOLD = [f"tests/integration/test_{name}.py" for name in ("controllers", "leases")]


@pytest.mark.parametrize(("client", "simulation"), [*MIXED, ("rclpy", "rclpy")])
def test_the_integration_tests_pass_on_each_pair_of_backends(client, simulation, tmp_path):
    """The integration tests, with the client and the simulation each on a given backend.

    What fails is run again, four times at most: nodes on Fast DDS at times do not find each other, in which case a run
    would start them again, and genuine clients of rmw_zenoh_cpp that are made anew again and again are at times left
    without an answer. The first failure ends a pass, as all tests that follow may wait for the same node in vain.
    """

    tests = ["tests/integration"] if MIXED else TOLD

    def passes() -> bool:
        """Run the tests from the one that failed before. pytest shows what they print if all passes fail."""
        command = [sys.executable, "-m", "pytest", "-q", "-o", f"cache_dir={tmp_path}", "--stepwise", *tests]
        backends = {"THROWCOLLECT_ROS": client, "SIMULATION_ROS": simulation}
        return subprocess.run(command, cwd=ROOT, env={**os.environ, **backends}, check=False).returncode == 0

    needed = next((number for number in range(1, 6) if passes()), None)
    assert needed is not None
    if needed > 1:
        warnings.warn(f"{needed} passes were needed: {client}, {simulation}", stacklevel=1)
