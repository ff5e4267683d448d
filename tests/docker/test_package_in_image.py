"""An image with packages, made as docs/running.md says: nodes collect with its robot, and with its policy."""

from __future__ import annotations

import shutil
import uuid
from collections.abc import Iterator
from pathlib import Path

import pytest
from docker.client import DockerClient

from tests.e2e.collection import call_here, fingerprints
from tests.e2e.plugins import PLUGINS, process_with_plugins
from tests.pages import find_blocks, read_section
from throwcollect.collect.runtimes.docker.docker_engine import default_tag

pytestmark = pytest.mark.docker
ARM = """\
robot: {name: planar_arm}
task:
  start: {shoulder_joint: 0.0, elbow_joint: 0.0}
  end: {shoulder_joint: 1.4, elbow_joint: 0.3}
  duration_s: 0.5
sim: {engine: ballistic}
sweep: {sampler: uniform, parameters: {task.duration_s: {min: 0.35, max: 0.6}}}
trials: 4
"""
SWING = """\
class Swing:
    def __init__(self, config):
        self.end = [config.task.end[joint] for joint in config.moving_joints]

    def reset(self, seed, target):
        pass

    def act(self, observation):
        share = min(observation["time_s"][0] + 0.02, 0.4) / 0.4
        return [share * end for end in self.end]
"""


@pytest.fixture
def image(client: DockerClient, tmp_path: Path) -> Iterator[str]:
    """An image with the robot of `tests/plugins`, made by the Dockerfile of the page."""
    (text,) = find_blocks("dockerfile", read_section("running.md", "Containers"))
    assert f"FROM {default_tag()}\n" in text
    context = tmp_path / "context"
    for name in ("planar_arm", "planar_arm-1.0.dist-info"):
        shutil.copytree(PLUGINS / name, context / "site" / name)
    (context / "site" / "swing.py").write_text(SWING)
    (context / "Dockerfile").write_text(text)
    tag = f"throwcollect-test:{uuid.uuid4().hex[:8]}"
    client.images.build(path=str(context), tag=tag, rm=True)
    yield tag
    client.images.remove(tag)


def test_nodes_find_the_robot_and_the_policy_that_their_image_has(image: str, tmp_path: Path) -> None:
    (tmp_path / "arm.yaml").write_text(ARM)
    asked = ARM.replace("duration_s: 0.5", "policy: {use: 'swing:Swing'}").replace("task.duration_s", "ball.mass_kg")
    (tmp_path / "policy.yaml").write_text(asked.replace("0.35", "0.04").replace("0.6", "0.05"))
    in_image = ("--runtime", "docker", "--set", f"containers.image={image}", "-n", "1")
    with process_with_plugins(tmp_path / "context" / "site") as process:
        for name in ("arm", "policy"):
            there, here = tmp_path / f"{name}-there", tmp_path / f"{name}-here"
            for directory, options in ((there, in_image), (here, ("--runtime", "inprocess"))):
                words = ("up", tmp_path / f"{name}.yaml", "--output", directory, *options)
                done = process.submit(call_here, *words).result()
                assert done.returncode == 0, done.stderr
            assert fingerprints(there) == fingerprints(here)
