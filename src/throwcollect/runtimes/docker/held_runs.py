"""The runs that an engine holds, whoever started them, and how to remove what is left of one."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from typing import Any

from docker.client import DockerClient
from docker.errors import NotFound

from throwcollect.errors import WorkerError
from throwcollect.runtimes.docker.engine import ENGINE_ERRORS, engine_errors, in_words
from throwcollect.runtimes.docker.options import (
    DIRECTORY_LABEL,
    JOINED_LABEL,
    KEY_LABEL,
    NODE_LABEL,
    RUN_LABEL,
    VERSION_LABEL,
)
from throwcollect.runtimes.runtime import HeldNode, HeldRun

_GRACE_S = 3
_AT_ONCE = 8


def find_held_runs(client: DockerClient) -> list[HeldRun]:
    """All runs of which an engine holds containers or a network, by name.

    Raises:
        WorkerError: If the engine does not answer.
    """
    filters = {"label": RUN_LABEL}
    with engine_errors("the Docker engine does not say what it holds"):
        containers = client.api.containers(all=True, filters=filters)
        networks = client.api.networks(filters=filters)
    labels = {each["Labels"][RUN_LABEL]: each["Labels"] for each in (*networks, *containers)}
    nodes: dict[str, list[HeldNode]] = {}
    for each in containers:
        if name := each["Labels"].get(NODE_LABEL):
            found = HeldNode(name, each["State"], each["Id"][:12])
            nodes.setdefault(each["Labels"][RUN_LABEL], []).append(found)
    return [
        HeldRun(
            run_id,
            labels[run_id].get(DIRECTORY_LABEL, ""),
            labels[run_id].get(VERSION_LABEL, ""),
            tuple(sorted(nodes.get(run_id, []), key=lambda node: node.name)),
        )
        for run_id in sorted(labels)
    ]


def remove(client: DockerClient, run_id: str, *, volumes: bool) -> list[str]:
    """Remove what an engine holds of a run, its key included; its containers are asked to end first.

    So are those that have joined it, which keep its network and its key from being removed.

    Args:
        client: Client of the engine.
        run_id: Name of the run.
        volumes: Whether to remove the volume that was made for the dataset, too, and the dataset with it.

    Returns:
        Names of what was removed.

    Raises:
        WorkerError: If something could not be removed, after everything else was.
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
        found_volumes = client.api.volumes(filters=filters)["Volumes"] or []
    # Containers first, side by side as each has some time to end: networks and volumes in use cannot be removed.
    with ThreadPoolExecutor(_AT_ONCE) as pool:
        for each in containers:
            pool.submit(attempt, each["Names"][0].lstrip("/"), partial(end, each))
    for each in networks:
        attempt(f"network {each['Name']}", partial(client.api.remove_network, each["Id"]))
    for each in (each for each in found_volumes if volumes or KEY_LABEL in each["Labels"]):
        attempt(f"volume {each['Name']}", partial(client.api.remove_volume, each["Name"]))
    if failures:
        raise WorkerError(f"run {run_id}: not everything could be removed", evidence="\n".join(sorted(failures)))
    return sorted(removed)
