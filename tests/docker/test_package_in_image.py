"""An image with the package of another robot, made as docs/containers.md says: its nodes collect with that robot."""

from __future__ import annotations

import re
import shutil
import uuid
from collections.abc import Iterator
from pathlib import Path

import pytest
from docker.client import DockerClient

from tests.e2e.collection import call_here, fingerprints
from tests.e2e.plugins import PLUGINS, process_with_plugins
from throwcollect.runtimes.docker.docker_engine import default_tag

pytestmark = pytest.mark.docker
PAGE = Path(__file__).parents[2] / "docs" / "containers.md"
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


@pytest.fixture
def image(client: DockerClient, tmp_path: Path) -> Iterator[str]:
    """An image with the robot of `tests/plugins`, made by the Dockerfile of the page."""
    (text,) = re.findall(r"```dockerfile\n(.+?)```", PAGE.read_text(encoding="utf-8"), re.DOTALL)
    assert f"FROM {default_tag()}\n" in text
    context = tmp_path / "context"
    for name in ("planar_arm", "planar_arm-1.0.dist-info"):
        shutil.copytree(PLUGINS / name, context / "site" / name)
    (context / "Dockerfile").write_text(text)
    tag = f"throwcollect-test:{uuid.uuid4().hex[:8]}"
    client.images.build(path=str(context), tag=tag, rm=True)
    yield tag
    client.images.remove(tag)


def test_nodes_find_the_robot_of_a_package_that_their_image_has(image: str, tmp_path: Path) -> None:
    (tmp_path / "arm.yaml").write_text(ARM)
    there, here = tmp_path / "there", tmp_path / "here"
    with process_with_plugins() as process:
        for directory, *options in (
            (there, "--runtime", "docker", "--set", f"containers.image={image}", "-n", "1"),
            (here, "--runtime", "inprocess"),
        ):
            words = ("up", tmp_path / "arm.yaml", "--output", directory, *options)
            done = process.submit(call_here, *words).result()
            assert done.returncode == 0, done.stderr
    assert fingerprints(there) == fingerprints(here)
