"""Volumes of the engine: how a dataset or the key of a run gets into one, and what can be asked about a dataset."""

from __future__ import annotations

import io
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
from throwcollect.run_key import RunKey
from throwcollect.runtimes.docker.engine import ENGINE_ERRORS, engine_errors
from throwcollect.runtimes.docker.options import DATA, KEY, KEY_LABEL, RunPlace, confine, image

_IN_MEMORY = 16 * 1024**2
_INFO_S = 120
_INFO = TypeAdapter(Info)


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
        # The container is never started: the engine writes into the mounts of a stopped one, too.
        _single(client, place, config, ["--version"], place.mount(read_only=False)) as container,
    ):
        with tarfile.open(fileobj=packed, mode="w") as archive:
            archive.add(directory, arcname=place.run_id, filter=_give_to_caller)
        packed.seek(0)
        container.put_archive(DATA, packed)


def place_key(client: DockerClient, place: RunPlace, config: Config, key: RunKey) -> None:
    """Make the volume with the run's key, whose files the caller's uid alone can read there.

    It goes the engine's way for files, so that the key is on no command line and in nothing that the engine tells of
    containers.

    Args:
        client: Client of the engine.
        place: The run.
        config: Its configuration.
        key: The key.

    Raises:
        WorkerError: If the engine refuses.
        ConfigError: If the key cannot be read.
    """
    key.check()
    with engine_errors(f"the key of run {place.run_id} cannot be copied into the volume {place.key_volume}"):
        client.volumes.create(place.key_volume, labels={**place.labels(), KEY_LABEL: ""})
        packed = io.BytesIO()
        with tarfile.open(fileobj=packed, mode="w") as archive:
            for path in (key.certificate, key.private_key):
                archive.add(path, arcname=path.name, filter=_let_caller_read)
        with _single(client, place, config, ["--version"], place.key_mount(read_only=False)) as container:
            container.put_archive(str(KEY.directory), packed.getvalue())


def dataset_info(client: DockerClient, place: RunPlace, config: Config) -> Info:
    """Summary of the dataset in the volume, which a container prints.

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
        _single(client, place, config, command, place.mount(read_only=True)) as container,
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


def _let_caller_read(member: tarfile.TarInfo) -> tarfile.TarInfo:
    member.mode = 0o400
    return _give_to_caller(member)


@contextmanager
def _single(
    client: DockerClient, place: RunPlace, config: Config, command: list[str], mount: Mount
) -> Iterator[Container]:
    """A container of the run that is no node of it, without a network; removed at the end."""
    container = client.containers.create(
        **confine(place, image(config)), command=command, mounts=[mount], network_mode="none"
    )
    try:
        yield container
    finally:
        with suppress(*ENGINE_ERRORS):
            container.remove(v=True, force=True)
