"""Copies datasets into volumes of the engine, and reads the summary of a dataset in a volume."""

from __future__ import annotations

import os
import tarfile
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from docker.client import DockerClient
from docker.models.containers import Container
from docker.types import Mount
from pydantic import TypeAdapter

from throwcollect.config.schema import Config
from throwcollect.dataset.summary import Info
from throwcollect.errors import DatasetError
from throwcollect.runtimes.docker.container_options import DATA, RunPlace, confine, image
from throwcollect.runtimes.docker.docker_engine import ENGINE_ERRORS, engine_errors

_IN_MEMORY = 16 * 1024**2
_INFO_S = 120
_INFO = TypeAdapter(Info)


def place_directory(client: DockerClient, place: RunPlace, config: Config, directory: Path) -> None:
    """Copy a prepared directory into the run's directory of the volume, where the files belong to this user."""
    with (
        engine_errors(f"{directory} cannot be copied into the volume {place.source}"),
        tempfile.SpooledTemporaryFile(_IN_MEMORY) as packed,
        # The container need not be started, because the engine also writes into the mounts of a stopped one.
        _make_single_container(client, place, config, ["--version"], place.mount(read_only=False)) as container,
    ):
        with tarfile.open(fileobj=packed, mode="w") as archive:
            archive.add(directory, arcname=place.run_id, filter=_give_to_caller)
        packed.seek(0)
        container.put_archive(DATA, packed)


def dataset_info(client: DockerClient, place: RunPlace, config: Config) -> Info:
    """Let a container print the summary of the dataset in the volume, and read it."""
    command = ["dataset", "info", place.data, "--json"]
    with (
        engine_errors(f"the dataset in the volume {place.source} cannot be looked at"),
        _make_single_container(client, place, config, command, place.mount(read_only=True)) as container,
    ):
        container.start()
        code = container.wait(timeout=_INFO_S)["StatusCode"]
        output = container.logs(stdout=True, stderr=False)
        messages = container.logs(stdout=False, stderr=True).decode(errors="replace").strip()
    if code:
        raise DatasetError(f"volume {place.source}: {place.data} holds no finished dataset", evidence=messages)
    return _INFO.validate_json(output)


def _give_to_caller(member: tarfile.TarInfo) -> tarfile.TarInfo:
    member.uid, member.gid = os.getuid(), os.getgid()
    member.uname = member.gname = ""
    return member


@contextmanager
def _make_single_container(
    client: DockerClient, place: RunPlace, config: Config, command: list[str], mount: Mount
) -> Iterator[Container]:
    """Create a container without a network for a single command; it is removed after the block."""
    container = client.containers.create(
        **confine(place, image(config)), command=command, mounts=[mount], network_mode="none"
    )
    try:
        yield container
    finally:
        with suppress(*ENGINE_ERRORS):
            container.remove(v=True, force=True)
