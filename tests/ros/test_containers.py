"""Containers whose nodes run on genuine rclpy: the same files as on the embedded backend, whatever is killed."""

from __future__ import annotations

import os
import time
from pathlib import Path

import docker
import psutil
import pytest

from tests.docker.conftest import client
from tests.docker.test_up import containers_of, engine
from tests.e2e.collection import FAST, collect_here, fingerprints, start, write_config
from throwcollect.collect.runtimes.docker.docker_engine import RMW_LABEL, default_tag

pytestmark = [pytest.mark.docker, pytest.mark.usefixtures("client")]
__all__ = ["client", "engine"]


def test_nodes_that_are_stuck_are_unhealthy_and_that_are_killed_come_back_and_find_each_other(
    engine: docker.DockerClient, tmp_path: Path
) -> None:
    config, directory = write_config(tmp_path, trials=32, sim=FAST), tmp_path / "data"
    collect_here(config, tmp_path / "undisturbed", "--set", "run.ros=embedded")
    # Slow enough to go on for longer than a router that was killed stays away.
    slow = ("--set", "sim.real_time_factor=1", "--set", "run.trial_timeout_s=20")
    rclpy = ("--runtime", "docker", "--set", "run.ros=rclpy", *slow)
    running = start(config, directory, 2, *rclpy)
    running.wait_until(lambda: running.count_bytes() > 0)
    nodes = containers_of(engine, directory)
    assert nodes.keys() == {"router", "sim_0", "sim_1", "coordinator"}
    for node in nodes.values():
        running.wait_until(lambda node=node: look_at(node) == 0)
    # Only the process is suspended, not the container, so that the launcher does not replace the node.
    (stuck,) = psutil.Process(nodes["sim_1"].attrs["State"]["Pid"]).children()
    stuck.suspend()
    try:
        time.sleep(6.0)
        assert look_at(nodes["sim_1"]) == 1
    finally:
        stuck.resume()
    for name in ("router", "sim_0", "coordinator"):
        size = running.count_bytes()
        before = containers_of(engine, directory)[name]
        before.kill()
        running.wait_until(lambda name=name, old=before.id: is_another(engine, directory, name, old))
        if name == "router":
            assert address_of(containers_of(engine, directory)[name]) == address_of(before)
        running.wait_until(lambda size=size: running.count_bytes() > size)
    code, _, err = running.finish()
    assert code == 0, err
    assert f"Docker containers of {default_tag()} on genuine rclpy with rmw_fastrtps_cpp" in err
    collected, undisturbed = fingerprints(directory), fingerprints(tmp_path / "undisturbed")
    for name in ("small_00000.mcap", "throws.parquet"):
        assert collected[name] == undisturbed[name]


def test_a_label_of_the_image_names_the_rmw_of_its_rclpy(client: docker.DockerClient) -> None:
    assert client.images.get(default_tag()).labels[RMW_LABEL] == "rmw_fastrtps_cpp"
    assert os.environ.get("THROWCOLLECT_ROS") is None


def look_at(container: docker.models.containers.Container) -> int:
    """Exit code of the health check of its image."""
    code, _ = container.exec_run(["sh", "-c", container.image.attrs["Config"]["Healthcheck"]["Test"][1]])
    return code


def is_another(engine: docker.DockerClient, directory: Path, name: str, old: str) -> bool:
    node = containers_of(engine, directory).get(name)
    return node is not None and node.id != old and node.status == "running"


def address_of(container: docker.models.containers.Container) -> str:
    (network,) = container.attrs["NetworkSettings"]["Networks"].values()
    return network["IPAddress"]
