from collections.abc import Iterator
from contextlib import closing
from pathlib import Path

import pytest
from docker.client import DockerClient
from docker.errors import ImageNotFound

from throwcollect.errors import WorkerError
from throwcollect.runtimes.docker.docker_engine import connect, default_tag, is_outdated

UNAVAILABLE = Path(__file__).parents[2] / "build" / "engine-unavailable"


@pytest.fixture(scope="session")
def client() -> Iterator[DockerClient]:
    """A client of an engine that has the image."""
    try:
        found = connect()
    except WorkerError as error:
        # Continuous integration writes this file with the reason if it could not start an engine.
        pytest.skip(UNAVAILABLE.read_text().strip() if UNAVAILABLE.exists() else error.message)
    with closing(found):
        try:
            found.images.get(default_tag())
        except ImageNotFound:
            pytest.skip(f"the engine has no image {default_tag()}; make image builds it")
        if is_outdated(found, default_tag()):
            pytest.skip(f"the image {default_tag()} is of other sources; make image builds it anew")
        yield found
