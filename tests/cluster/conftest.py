import os
import pwd
import shutil
import subprocess
import tempfile
from collections.abc import Iterator
from pathlib import Path

import pytest
from docker.client import DockerClient

from tests.cluster.slurm import Slurm
from tests.docker.conftest import client
from throwcollect.collect.runtimes.docker import docker_engine as image

BUILD = Path(__file__).parents[2] / "build"
UNAVAILABLE = BUILD / "cluster-unavailable"
__all__ = ["client"]
USER = "throwcollect-ci"
"""The user of the jobs, who has no special rights."""
SHARED = "throwcollect-shared-"
"""Names of directories that tests share with jobs begin so."""


@pytest.fixture(scope="session", autouse=True)
def _cluster() -> None:
    """Skip all tests of this directory on a machine without the programs of a cluster."""
    # Continuous integration writes this file with the reason if it could not install a cluster.
    if UNAVAILABLE.exists():
        pytest.skip(UNAVAILABLE.read_text().strip())
    path = f"{os.environ.get('PATH', '')}:/usr/sbin:/sbin"
    missing = [name for name in ("apptainer", "slurmctld", "munged") if shutil.which(name, path=path) is None]
    if missing:
        pytest.skip(f"not installed: {', '.join(missing)}; .ci/cluster.sh installs it on Debian")
    if os.getuid() != 0:
        pytest.skip("only root can start a Slurm of several nodes")
    if not any(each.pw_name == USER for each in pwd.getpwall()):
        pytest.skip(f"there is no user {USER}; .ci/cluster.sh makes one")


@pytest.fixture
def shared() -> Iterator[Path]:
    """A directory that all nodes see, and that belongs to the user of the jobs."""
    with tempfile.TemporaryDirectory(prefix=SHARED) as path:
        shutil.chown(path, USER, USER)
        yield Path(path)


@pytest.fixture(scope="session")
def slurm() -> Iterator[Slurm]:
    """A Slurm of four nodes."""
    with tempfile.TemporaryDirectory(prefix="throwcollect-slurm-") as path:
        started = Slurm(Path(path))
        try:
            started.up(4)
            yield started
        finally:
            started.down()


@pytest.fixture(scope="session")
def sif(client: DockerClient) -> Iterator[Path]:
    """The image of these sources as a SIF that all users can read; made once for each image."""
    name = image.default_tag()
    kept = BUILD / "sif" / f"{client.images.get(name).id.removeprefix('sha256:')}.sif"
    if not kept.exists():
        # SIFs of earlier images are no longer needed.
        shutil.rmtree(kept.parent, ignore_errors=True)
        kept.parent.mkdir(parents=True)
        subprocess.run(["make", "sif", f"SIF={kept}"], cwd=BUILD.parent, check=True)
    with tempfile.TemporaryDirectory(prefix="throwcollect-sif-") as path:
        Path(path).chmod(0o755)
        yield Path(shutil.copy(kept, path))
