"""A dataset in a volume of the engine: how it gets in, and what can be asked about it."""

from __future__ import annotations

import json
import os
import tarfile
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

from docker.client import DockerClient
from docker.models.containers import Container

from throwcollect.config.schema import Config
from throwcollect.errors import DatasetError
from throwcollect.runtime.docker_engine import ENGINE_ERRORS, engine_errors
from throwcollect.runtime.docker_options import DATA, RunPlace, confined

_IN_MEMORY = 16 * 1024**2
_INFO_S = 120


def place_directory(client: DockerClient, place: RunPlace, config: Config, directory: Path) -> None:
    """Copy a prepared directory into the run's directory of the volume; the files belong to the caller there.

    Args:
        client: Client of the engine.
        place: The run.
        config: Its configuration.
        directory: What to copy.

    Raises:
        WorkerError: If it cannot be copied.
    """
    with (
        engine_errors(f"{directory} cannot be copied into the volume {place.source}"),
        tempfile.SpooledTemporaryFile(_IN_MEMORY) as packed,
        # It need not run: the engine writes into its mounts.
        _single(client, place, config, ["--version"], read_only=False) as container,
    ):
        with tarfile.open(fileobj=packed, mode="w") as archive:
            archive.add(directory, arcname=place.run_id, filter=_owned_by_caller)
        packed.seek(0)
        container.put_archive(DATA, packed)


def dataset_info(client: DockerClient, place: RunPlace, config: Config) -> dict[str, Any]:
    """Summary of the dataset in the volume, as ``throwcollect dataset info --json`` prints it.

    Args:
        client: Client of the engine.
        place: The run.
        config: Its configuration.

    Raises:
        WorkerError: If the engine cannot be asked.
        DatasetError: If there is no finished dataset.
    """
    command = ["dataset", "info", place.data, "--json"]
    with (
        engine_errors(f"the dataset in the volume {place.source} cannot be looked at"),
        _single(client, place, config, command, read_only=True) as container,
    ):
        container.start()
        code = container.wait(timeout=_INFO_S)["StatusCode"]
        output = container.logs(stdout=True, stderr=False)
        messages = container.logs(stdout=False, stderr=True).decode(errors="replace").strip()
    if code:
        raise DatasetError(f"volume {place.source}: {place.data} holds no finished dataset", evidence=messages)
    summary: dict[str, Any] = json.loads(output)
    return summary


def _owned_by_caller(member: tarfile.TarInfo) -> tarfile.TarInfo:
    member.uid, member.gid = os.getuid(), os.getgid()
    member.uname = member.gname = ""
    return member


@contextmanager
def _single(
    client: DockerClient, place: RunPlace, config: Config, command: list[str], *, read_only: bool
) -> Iterator[Container]:
    """A container of the run that is no node of it, without a network; removed at the end."""
    container = client.containers.create(
        **confined(place, config), command=command, mounts=[place.mount(read_only=read_only)], network_mode="none"
    )
    try:
        yield container
    finally:
        with suppress(*ENGINE_ERRORS):
            container.remove(v=True, force=True)
