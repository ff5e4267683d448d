"""Our nodes on genuine rclpy, beside nodes on the embedded backend and by themselves."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from tests.e2e.collection import command, fingerprints, write_config

ROOT = Path(__file__).parents[2]


@pytest.mark.parametrize(("client", "simulation"), [("rclpy", "embedded"), ("embedded", "rclpy"), ("rclpy", "rclpy")])
def test_a_simulation_behaves_alike_whatever_backend_it_and_its_client_are_on(client, simulation, zenoh_rmw, tmp_path):
    """The integration tests, with the client and the simulation each on a given backend.

    What fails is run once more: genuine clients of rmw_zenoh_cpp that are made anew again and again are at times left
    without an answer, by genuine servers too.
    """

    def run(*options: str) -> subprocess.CompletedProcess[str]:
        return subprocess.run(
            [sys.executable, "-m", "pytest", "-q", "-o", f"cache_dir={tmp_path}", *options, "tests/integration"],
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


def test_the_dataset_does_not_depend_on_the_backend(tmp_path):
    config = write_config(tmp_path, trials=12)
    for backend in ("embedded", "rclpy"):
        found = subprocess.run(
            command("up", "-n", "2", "--runtime", "local", config, "--output", tmp_path / backend),
            env={**os.environ, "THROWCOLLECT_ROS": backend},
            capture_output=True,
            text=True,
            timeout=300,
            check=False,
        )
        assert found.returncode == 0, found.stdout + found.stderr
    assert fingerprints(tmp_path / "rclpy") == fingerprints(tmp_path / "embedded")
