"""Removes everything that an engine holds of a run."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from typing import Any

from docker.client import DockerClient
from docker.errors import NotFound

from throwcollect.errors import WorkerError
from throwcollect.runtimes.docker.container_options import JOINED_LABEL, RUN_LABEL
from throwcollect.runtimes.docker.docker_engine import ENGINE_ERRORS, engine_errors, in_words

_GRACE_S = 3
_AT_ONCE = 8


def remove(client: DockerClient, run_id: str) -> list[str]:
    """Remove everything that an engine holds of a run.

    Containers that have joined the run are ended, too, because its network cannot be removed before.

    Returns:
        Names of the containers and networks that were removed.
    """
    filters = {"label": f"{RUN_LABEL}={run_id}"}
    removed: list[str] = []
    failures: list[str] = []

    def attempt(name: str, action: Callable[[], None]) -> None:
        try:
            action()
        except NotFound:
            return
        except ENGINE_ERRORS as error:
            failures.append(f"{name}: {in_words(error)}")
        else:
            removed.append(name)

    def end(container: dict[str, Any]) -> None:
        client.api.stop(container["Id"], timeout=_GRACE_S)
        client.api.remove_container(container["Id"], v=True, force=True)

    with engine_errors(f"run {run_id} cannot be removed"):
        joined = client.api.containers(all=True, filters={"label": f"{JOINED_LABEL}={run_id}"})
        containers = [*client.api.containers(all=True, filters=filters), *joined]
        networks = client.api.networks(filters=filters)
    # Containers come first, because networks that are in use cannot be removed.
    with ThreadPoolExecutor(_AT_ONCE) as pool:
        for container in containers:
            pool.submit(attempt, container["Names"][0].lstrip("/"), partial(end, container))
    for network in networks:
        attempt(f"network {network['Name']}", partial(client.api.remove_network, network["Id"]))
    if failures:
        raise WorkerError(f"run {run_id}: not everything could be removed", evidence="\n".join(sorted(failures)))
    return sorted(removed)
