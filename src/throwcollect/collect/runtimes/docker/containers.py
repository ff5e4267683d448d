"""The host of nodes that are containers of a Docker engine, and the end of all containers of a run."""

from __future__ import annotations

import math
import signal
import threading
import time
from abc import abstractmethod
from collections.abc import Callable, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import suppress
from dataclasses import dataclass
from functools import partial
from typing import Any

from docker.client import DockerClient
from docker.errors import NotFound

from throwcollect.collect.runtimes.docker.container_options import (
    JOINED_LABEL,
    NODE_LABEL,
    RUN_LABEL,
    name_container,
    name_network,
)
from throwcollect.collect.runtimes.docker.docker_engine import ENGINE_ERRORS, describe_error, engine_errors
from throwcollect.collect.runtimes.node_logs import NodeLogs
from throwcollect.collect.runtimes.nodes import ROUTER, NodeExit, NodeHost, NodeSpec, describe_end
from throwcollect.collect.runtimes.run_record import RunRecord
from throwcollect.config.run import NodeContainerConfig
from throwcollect.config.schema import Config
from throwcollect.errors import Interrupted, WorkerError
from throwcollect.files import open_log
from throwcollect.wording import command

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
_SIGNALLED = 128
"""Exit codes above this are those of a signal."""


@dataclass
class Container:
    """A container of a node, as the engine last described it.

    Attributes:
        starting: Gives its id.
        status: The engine's word, such as ``running``, ``paused`` or ``exited``; ``removed`` if the container is gone.
        code: Exit code; None while the container runs, or if it is gone.
        out_of_memory: Whether the kernel has killed a process of the container for lack of memory.
        address: Address in the run's network; None if the container has none.
        printed: Time of the last line in the log.
    """

    node: str
    starting: Future[str]
    status: str = "created"
    code: int | None = None
    out_of_memory: bool = False
    address: str | None = None
    printed: bytes = b""

    @property
    def id(self) -> str | None:
        """Its id; None if it has not been started (yet)."""
        has_started = self.starting.done() and not self.starting.cancelled() and self.starting.exception() is None
        return self.starting.result() if has_started else None

    @property
    def ended(self) -> bool:
        """Whether the container will never run again."""
        return self.status in ("exited", "dead", "removed")

    def describe_end(self, memory: str | None) -> str:
        """How the container, which has this memory limit, ended."""
        if self.code is None:
            return "its container was removed"
        # `out_of_memory` alone proves nothing: the kernel may have killed another process, and the container went on.
        if self.out_of_memory and self.code == _SIGNALLED + signal.SIGKILL:
            return "ran out of memory" + (f" (limit {memory})" if memory else "")
        number = self.code - _SIGNALLED
        signalled = number in signal.valid_signals() and self.code != Interrupted.exit_code
        return describe_end(-number if signalled else self.code)


class ContainerHost(NodeHost):
    """Starts, watches and removes the containers of a run; a thread reads their states and output twice a second.

    Containers and networks carry the run's id as a label, by which `down` finds them if the launcher dies.

    Args:
        record: The run; its id has to be unique on the engine.
        warn: Gets a line when the engine is silent for long.
    """

    def __init__(self, record: RunRecord, config: Config, client: DockerClient, warn: Callable[[str], None]) -> None:
        self.record = record
        self.config = config
        self.cleared = False
        self.logs = NodeLogs(record.logs)
        self.containers: dict[str, Container] = {}
        self._client = client
        self._warn = warn
        self._warned = self._unwritable = self._given_up = False
        self._last_error = ""
        self._pool = ThreadPoolExecutor(_AT_ONCE)
        self._copying = threading.Lock()
        self._closed = threading.Event()
        self._answered_at = time.monotonic()

    @abstractmethod
    def find_section(self, name: str) -> NodeContainerConfig:
        """The section of the configuration, or of the catalogue, for a node's container."""

    @abstractmethod
    def make_options(self, node: NodeSpec) -> tuple[dict[str, Any], Sequence[str]]:
        """Keywords for `containers.create`, and the networks that the container joins besides that in them."""

    def open(self) -> None:
        """Begin to watch."""
        super().open()
        self._answered_at = time.monotonic()
        threading.Thread(target=self._watch, daemon=True).start()

    def start(self, node: NodeSpec) -> None:
        """Begin to start a node, and remove an ended container of the same name."""
        self.containers[node.name] = Container(node.name, self._pool.submit(self._start, *self.make_options(node)))

    def handle(self, name: str) -> str | None:
        """Short id of a running node's container; None if the container does not run (yet)."""
        container = self.containers.get(name)
        return container.id[:12] if container is not None and container.id is not None else None

    def running(self) -> tuple[str, ...]:
        """See `NodeHost.running`."""
        return tuple(self.containers)

    def exits(self) -> list[NodeExit]:
        """The nodes that ended, or could not be started, since the last call."""
        self._check_engine()
        ends = [end for container in self.containers.values() if (end := self._find_end(container)) is not None]
        for end in ends:
            del self.containers[end.name]
        return ends

    def frozen(self) -> frozenset[str]:
        """Names of the nodes whose containers are paused."""
        return frozenset(name for name, container in self.containers.items() if container.status == "paused")

    def signal(self, name: str, number: signal.Signals) -> None:
        """Send a signal to a node once it runs, unless it has ended."""
        # A node that is not there, or cannot be started, gets none.
        with suppress(KeyError, *ENGINE_ERRORS):
            self._client.api.kill(self.containers[name].starting.result(), int(number))

    def stop(self, names: Sequence[str], *, grace_s: float = _GRACE_S) -> None:
        """End nodes and remove their containers: with SIGTERM, then after `grace_s`, in whole seconds, by force."""
        ending = [self.containers.pop(name) for name in names if name in self.containers]
        with ThreadPoolExecutor(_AT_ONCE) as pool:
            for container in ending:
                pool.submit(self._remove, container, math.ceil(grace_s))

    def close(self) -> None:
        """End all nodes, the router last, and remove everything that was made for the run.

        Afterwards, `cleared` is true if the engine has removed all containers.
        """
        if not self._given_up:
            self.stop([name for name in self.containers if name != ROUTER])
            self.stop([ROUTER])
            # The network cannot be removed while a foreign container is in it.
            with suppress(WorkerError):
                remove(self._client, self.record.run)
            with suppress(*ENGINE_ERRORS):
                self.cleared = not self._list()
        self._closed.set()
        self._pool.shutdown(wait=False, cancel_futures=True)

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

    def _find_end(self, container: Container) -> NodeExit | None:
        """How a node ended; None while it runs."""
        name = container.node
        if container.starting.done() and (error := container.starting.exception()) is not None:
            return NodeExit(name, None, f"cannot be started: {describe_error(error)}", self.logs.tail(name))
        if not container.ended:
            return None
        reason = container.describe_end(self.find_section(name).memory)
        return NodeExit(name, container.code, reason, self.logs.tail(name))

    def _check_engine(self) -> None:
        """Warn the user if the engine has not answered for long, and again when it answers; end the run at last."""
        silent_s = time.monotonic() - self._answered_at
        if (silent_s >= _WARN_S) != self._warned:
            self._warned = not self._warned
            silent = f"the Docker engine has not answered for {silent_s:.0f} s; waiting"
            self._warn(silent if self._warned else "the Docker engine answers again")
        if self._given_up:
            left = ", ".join(name_container(self.record.run, name) for name in self.containers) or "none"
            hint = f"once it answers, {command('down', '--run', self.record.run)} ends them"
            if (again := self.record.resume_command) is not None:
                hint += f", and {again} goes on without them"
            raise WorkerError(
                f"the Docker engine has not answered for {silent_s:.0f} s",
                evidence="\n".join(filter(None, (self._last_error, f"containers that may run on: {left}"))),
                hint=hint,
            )

    def _watch(self) -> None:
        while not self._closed.wait(_POLL_S):
            try:
                self._look()
            except ENGINE_ERRORS as error:
                self._last_error = describe_error(error)
                # Only a request that failed counts: this process itself may have been stopped for a while.
                self._given_up = self._given_up or time.monotonic() - self._answered_at >= SILENCE_S
            else:
                self._answered_at = time.monotonic()

    def _list(self) -> dict[str, dict[str, Any]]:
        filters = {"label": [f"{RUN_LABEL}={self.record.run}", NODE_LABEL]}
        return {each["Id"]: each for each in self._client.api.containers(all=True, filters=filters)}

    def _look(self) -> None:
        # A container that is started meanwhile is not in the list, so the ids come first.
        known = [(container, key) for container in list(self.containers.values()) if (key := container.id)]
        listed = self._list()
        for container, key in known:
            # What was printed before the end is in the log before the end is known.
            self._copy_log(container, key)
            self._update(container, key, listed.get(key))

    def _update(self, container: Container, key: str, listed: dict[str, Any] | None) -> None:
        """Take in what the engine has listed of a container; None if it is gone."""
        status = "removed" if listed is None else listed["State"]
        if listed is not None:
            network = listed["NetworkSettings"]["Networks"].get(name_network(self.record.run), {})
            container.address = network.get("IPAddress") or None
        if status in ("exited", "dead"):
            try:
                details = self._client.api.inspect_container(key)["State"]
                container.out_of_memory, container.code = details["OOMKilled"], details["ExitCode"]
            except NotFound:
                status = "removed"
        # The status comes last, because the launcher's thread reads the rest once the container has ended.
        container.status = status

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
                    with open(open_log(self.logs.path(container.node)), "ab") as log:
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
