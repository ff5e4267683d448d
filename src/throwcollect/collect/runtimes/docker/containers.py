"""The containers of one run, whose states and output a thread reads twice a second."""

from __future__ import annotations

import math
import threading
import time
from collections.abc import Callable, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import suppress
from dataclasses import dataclass
from functools import partial
from typing import Any

from docker.client import DockerClient
from docker.errors import NotFound

from throwcollect.collect.runtimes.docker.container_options import JOINED_LABEL, NODE_LABEL, RUN_LABEL, network_of
from throwcollect.collect.runtimes.docker.docker_engine import ENGINE_ERRORS, describe_error, engine_errors
from throwcollect.collect.runtimes.node_logs import NodeLogs
from throwcollect.collect.runtimes.nodes import ROUTER
from throwcollect.errors import WorkerError
from throwcollect.files import open_log

ANSWER_S = 60.0
"""Longest wait for the answer to one request; a busy engine may take half a minute."""
SILENCE_S = 120.0
"""An engine that has not answered for this long is given up."""
_WARN_S = 15.0
_POLL_S = 0.5
_GRACE_S = 3
_AT_ONCE = 8
"""Starting more containers at the same time was measured to gain nothing."""
_TAIL_LINES = 200
"""Lines of a log that the engine is asked for; all of them are read only if so many are new."""


@dataclass(frozen=True)
class ContainerState:
    """A container as the engine last described it.

    Attributes:
        status: The engine's word, such as ``running``, ``paused`` or ``exited``; ``removed`` if the container is gone.
        code: Exit code; None while the container runs, or if it is gone.
        out_of_memory: Whether the kernel has killed a process of the container for lack of memory.
        address: Address in the run's network; None if the container has none.
    """

    status: str
    code: int | None = None
    out_of_memory: bool = False
    address: str | None = None

    @property
    def ended(self) -> bool:
        """Whether the container will never run again."""
        return self.status in ("exited", "dead", "removed")


@dataclass
class Container:
    """A container of a node.

    Attributes:
        starting: Gives its id.
        state: Its last state; None if there is none yet.
        printed: Time of the last line in the log.
    """

    node: str
    starting: Future[str]
    state: ContainerState | None = None
    printed: bytes = b""

    @property
    def id(self) -> str | None:
        """Its id; None if it has not been started (yet)."""
        has_started = self.starting.done() and not self.starting.cancelled() and self.starting.exception() is None
        return self.starting.result() if has_started else None

    @property
    def failure(self) -> str | None:
        """Reason why it could not be started; None if there is none."""
        error = self.starting.exception() if self.starting.done() else None
        return None if error is None else describe_error(error)

    @property
    def paused(self) -> bool:
        """Whether it is paused."""
        return self.state is not None and self.state.status == "paused"


class Containers:
    """Starts, watches and removes the containers of one run, each of which belongs to a node.

    Attributes:
        by_node: The containers by the names of their nodes, also those that have ended; the next start of a node, or
            `close`, removes one that is forgotten here.
        given_up: Whether the engine has not answered for so long that nothing more is asked of it.
        last_error: The reason of the last error of the engine; empty if there was none.

    Args:
        logs: The files to which the output of the containers is appended.
        warn: Gets a line when the engine does not answer for long.
    """

    def __init__(self, client: DockerClient, run: str, logs: NodeLogs, warn: Callable[[str], None]) -> None:
        self.given_up = False
        self.last_error = ""
        self._client = client
        self._run = run
        self._logs = logs
        self._warn = warn
        self._warned = self._unwritable = False
        self.by_node: dict[str, Container] = {}
        self._pool = ThreadPoolExecutor(_AT_ONCE)
        self._copying = threading.Lock()
        self._closed = threading.Event()
        self._answered_at = time.monotonic()

    def open(self) -> None:
        """Begin to watch."""
        self._answered_at = time.monotonic()
        threading.Thread(target=self._watch, daemon=True).start()

    @property
    def silent_s(self) -> float:
        """Time since the engine last answered [s]."""
        return time.monotonic() - self._answered_at

    def start(self, node: str, options: dict[str, Any], *, networks: Sequence[str]) -> None:
        """Begin to start a container, and remove an ended container of the same name.

        `options` are keywords for `containers.create`. The container joins `networks` besides the network in `options`.
        """
        self.by_node[node] = Container(node, self._pool.submit(self._start, options, networks))

    def remove(self, nodes: Sequence[str], *, grace_s: float) -> None:
        """End and remove containers: with SIGTERM, then after `grace_s`, in whole seconds, by force."""
        ending = [self.by_node.pop(node) for node in nodes if node in self.by_node]
        with ThreadPoolExecutor(_AT_ONCE) as pool:
            for container in ending:
                pool.submit(self._remove, container, math.ceil(grace_s))

    def close(self) -> bool:
        """Remove all containers, that of the router last, and everything else of the run.

        Returns:
            Whether the engine has removed all containers.
        """
        is_clear = False
        if not self.given_up:
            self.remove([node for node in self.by_node if node != ROUTER], grace_s=_GRACE_S)
            self.remove([ROUTER], grace_s=_GRACE_S)
            # The network cannot be removed while a foreign container is in it.
            with suppress(WorkerError):
                remove(self._client, self._run)
            with suppress(*ENGINE_ERRORS):
                is_clear = not self._list()
        self._closed.set()
        self._pool.shutdown(wait=False, cancel_futures=True)
        return is_clear

    def _start(self, options: dict[str, Any], networks: Sequence[str]) -> str:
        with suppress(NotFound):
            self._client.api.remove_container(options["name"], v=True, force=True)
        container = self._client.containers.create(**options)
        try:
            for network in networks:
                self._client.networks.get(network).connect(container)
            container.start()
        except ENGINE_ERRORS:
            with suppress(*ENGINE_ERRORS):
                container.remove(v=True, force=True)
            raise
        return str(container.id)

    def _remove(self, container: Container, grace_s: int) -> None:
        if container.starting.cancel():
            return
        with suppress(*ENGINE_ERRORS):
            # The engine cannot end a container that it is still starting.
            key = container.starting.result()
            self._client.api.stop(key, timeout=grace_s)
            self._copy_log(container, key)
            self._client.api.remove_container(key, v=True, force=True)

    def _list(self) -> dict[str, dict[str, Any]]:
        listed = self._client.api.containers(all=True, filters={"label": [f"{RUN_LABEL}={self._run}", NODE_LABEL]})
        return {each["Id"]: each for each in listed}

    def _watch(self) -> None:
        while not self._closed.wait(_POLL_S):
            try:
                self._look()
            except ENGINE_ERRORS as error:
                self.last_error = describe_error(error)
                # Only a request that failed counts: this process itself may have been stopped for a while.
                self.given_up = self.given_up or self.silent_s >= SILENCE_S
            else:
                self._answered_at = time.monotonic()

    def warn_if_silent(self) -> None:
        """Warn the user if the engine has not answered for long, and again when it answers."""
        if (self.silent_s >= _WARN_S) == self._warned:
            return
        self._warned = not self._warned
        silent = f"the Docker engine has not answered for {self.silent_s:.0f} s; waiting"
        self._warn(silent if self._warned else "the Docker engine answers again")

    def _look(self) -> None:
        # A container that is started meanwhile is not in the list, so the ids come first.
        known = [(container, key) for container in list(self.by_node.values()) if (key := container.id)]
        listed = self._list()
        for container, key in known:
            # What was printed before the end is in the log before the end is known.
            self._copy_log(container, key)
            container.state = self._inspect(listed.get(key), key)

    def _inspect(self, listed: dict[str, Any] | None, key: str) -> ContainerState:
        if listed is None:
            return ContainerState("removed")
        address = listed["NetworkSettings"]["Networks"].get(network_of(self._run), {}).get("IPAddress") or None
        state = ContainerState(listed["State"], address=address)
        if not state.ended:
            return state
        try:
            details = self._client.api.inspect_container(key)["State"]
        except NotFound:
            return ContainerState("removed")
        return ContainerState(details["Status"], details["ExitCode"], details["OOMKilled"])

    def _copy_log(self, container: Container, key: str) -> None:
        """Append the lines that a container has printed since the last call to the log of its node."""
        with self._copying, suppress(NotFound):
            new: list[tuple[bytes, bytes]] = []
            for tail in (_TAIL_LINES, "all"):
                lines = self._client.api.logs(key, timestamps=True, tail=tail).split(b"\n")
                stamped = (line.partition(b" ") for line in lines if line)
                new = [(stamp, text) for stamp, _, text in stamped if stamp > container.printed]
                if len(new) < _TAIL_LINES:
                    break
            if new:
                try:
                    with open(open_log(self._logs.path(container.node)), "ab") as log:
                        log.write(b"".join(text + b"\n" for _, text in new))
                except OSError as error:
                    # A full disk is no silence of the engine.
                    if not self._unwritable:
                        self._warn(f"logs of nodes cannot be written: {describe_error(error)}")
                    self._unwritable = True
                    return
                container.printed = new[-1][0]


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
            failures.append(f"{name}: {describe_error(error)}")
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
