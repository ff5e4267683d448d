from collections.abc import Iterator
from contextlib import closing
from pathlib import Path

import pytest
from docker.client import DockerClient

from throwcollect.collect.runtimes.docker.docker_engine import connect, default_tag, find_image
from throwcollect.collect.runtimes.image_sources import SOURCES_LABEL, are_others
from throwcollect.errors import WorkerError

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
        if (image := find_image(found, default_tag())) is None:
            pytest.skip(f"the engine has no image {default_tag()}; make image builds it")
        if are_others(image.labels.get(SOURCES_LABEL)):
            pytest.skip(f"the image {default_tag()} is of other sources; make image builds it anew")
        yield found
