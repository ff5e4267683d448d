"""The built image: what runs in a container with hardly any privileges, and which tools are not in it."""

from __future__ import annotations

import time
import uuid
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from docker.client import DockerClient
from docker.errors import ContainerError

import throwcollect
from throwcollect.collect.runtimes.docker.docker_engine import default_tag

pytestmark = pytest.mark.docker

ROOT = Path(__file__).parents[2]
CONFINED = {
    "init": True,
    "read_only": True,
    "tmpfs": {"/tmp": ""},
    "cap_drop": ["ALL"],
    "security_opt": ["no-new-privileges"],
    "network_mode": "none",
}
"""Privileges of the test container: at most those of a container of a run."""


def run(client: DockerClient, *command: str, **options: Any) -> str:
    return client.containers.run(default_tag(), list(command), remove=True, **{**CONFINED, **options}).decode()


def script(client: DockerClient, text: str, **options: Any) -> str:
    return run(client, "-c", text, entrypoint="sh", **options)


@pytest.fixture
def volume(client: DockerClient) -> Iterator[str]:
    made = client.volumes.create(f"throwcollect-test-{uuid.uuid4().hex[:8]}")
    yield made.name
    made.remove()


def test_the_arguments_of_a_container_go_to_throwcollect(client: DockerClient) -> None:
    assert run(client, "--version") == f"throwcollect {throwcollect.__version__}\n"


@pytest.mark.parametrize("user", ["4242:4242", "0:0", None])
def test_any_user_can_make_a_plan_on_a_read_only_file_system(client: DockerClient, user: str | None) -> None:
    sweep = "{sampler: sobol, parameters: {task.duration_s: {min: 1.0, max: 1.3}}}"
    command = f"echo '{{trials: 4, sweep: {sweep}}}' > /tmp/c.yaml && throwcollect plan /tmp/c.yaml --json"
    assert '"trial": 3' in script(client, command, user=user)


@pytest.mark.parametrize("user", ["4242:4242", "0:0"])
def test_any_user_may_write_into_a_new_volume_for_data(client: DockerClient, volume: str, user: str) -> None:
    mounted = {volume: {"bind": "/data", "mode": "rw"}}
    assert script(client, "pwd && mkdir mine && ls", user=user, volumes=mounted) == "/data\nmine\n"
    assert script(client, "stat -c %a /data", volumes=mounted) == "1777\n"


def test_the_image_has_all_that_its_nodes_load(client: DockerClient) -> None:
    """The self-test of the build; other tests collect in containers on genuine rclpy."""
    files = ("docker/selftest.sh", "configs/quickstart.yaml")
    mounted = {ROOT / file: {"bind": f"/build/{Path(file).name}", "mode": "ro"} for file in files}
    done = script(client, "sh /build/selftest.sh embedded", volumes=mounted, environment={"HOME": "/tmp"})
    assert "replayed: 4 of 4 throws, the same bit for bit" in done


def test_the_image_has_no_tools_that_build_or_install(client: DockerClient) -> None:
    tools = "pip pip3 gcc cc ld strip make cmake git"
    assert script(client, f"for tool in {tools}; do command -v $tool; done; true") == ""
    with pytest.raises(ContainerError, match="No module named pip"):
        script(client, "python -m pip")
    kinds = " -o ".join(f"-name '*.{kind}'" for kind in ("a", "whl", "hpp", "pyi"))
    assert script(client, f"find /opt /build /wheelhouse {kinds} 2>/dev/null; true") == ""


def test_the_image_has_the_built_in_robots_alone(client: DockerClient) -> None:
    robots = "ls /opt/venv/lib/python3*/site-packages/cmeel.prefix/share/example-robot-data/robots"
    packages = ("panda_description", "so_arm_description", "talos_data", "tiago_description", "ur_description")
    assert script(client, robots).split() == [*packages, "xarm_description"]


def test_the_image_runs_as_an_ordinary_user_and_declares_no_volume(client: DockerClient) -> None:
    config = client.images.get(default_tag()).attrs["Config"]
    assert config["User"] == "10001:10001"
    assert not config.get("Volumes")
    assert config["Healthcheck"]["Interval"] == 10 * 10**9


@pytest.fixture
def router(client: DockerClient) -> Iterator[Any]:
    options = {**CONFINED, "network_mode": None, "environment": {"THROWCOLLECT_NODE": "router"}}
    container = client.containers.run(default_tag(), ["router"], detach=True, **options)
    try:
        for line in container.logs(stream=True):
            if b"router listening" in line:
                break
        yield container
    finally:
        container.remove(force=True)


def healthcheck(client: DockerClient, container: Any, **environment: str) -> int:
    command = client.images.get(default_tag()).attrs["Config"]["Healthcheck"]["Test"]
    assert command[0] == "CMD-SHELL"
    assert "'5 seconds ago'" in command[1]
    code: int = container.exec_run(["sh", "-c", command[1]], environment=environment).exit_code
    return code


def test_a_router_with_a_recent_heartbeat_is_healthy(client: DockerClient, router: Any) -> None:
    assert healthcheck(client, router) == 0
    assert healthcheck(client, router, THROWCOLLECT_HEARTBEAT="/tmp/nobody") == 1


def test_a_router_that_is_stuck_is_unhealthy(client: DockerClient, router: Any) -> None:
    assert router.exec_run(["sh", "-c", "kill -STOP $(cat /proc/1/task/1/children)"]).exit_code == 0
    time.sleep(6.0)
    assert healthcheck(client, router) == 1
