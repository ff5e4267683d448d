"""Follows the states of the containers of one run, and the silence of their engine, with threads."""

from __future__ import annotations

import threading
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass
from typing import Any

from docker.client import DockerClient
from docker.errors import NotFound

from throwcollect.runtimes.docker.container_options import RUN_LABEL, RunPlace
from throwcollect.runtimes.docker.docker_engine import ENGINE_ERRORS, in_words, timed_out

SILENCE_S = 120.0
"""An engine that is silent for this long is given up; a busy engine may let a request wait for half a minute."""
_TICK_S = 0.5
_WARN_S = 15.0
"""The user is warned of a longer silence; a busy engine often takes some seconds for an answer."""


_EVENTS = ["start", "die", "oom", "destroy", "pause", "unpause", "health_status"]
_LOOK_EVERY_S = 2.0
"""Events arrive at once, but a stream of events may hang or break, so the containers are also listed, this often."""


@dataclass(frozen=True)
class ContainerState:
    """A container as the engine last described it.

    Attributes:
        status: The engine's word, such as ``running``, ``paused`` or ``exited``; ``removed`` if the container is gone.
        code: Exit code; None while the container runs.
        out_of_memory: Whether the kernel has killed a process of the container for lack of memory.
        healthy: Whether the last health check succeeded.
        address: Address in the run's network; None if the container has none.
    """

    status: str
    code: int | None = None
    out_of_memory: bool = False
    healthy: bool = False
    address: str | None = None

    @property
    def ended(self) -> bool:
        """Whether the container will never run again."""
        return self.status in ("exited", "dead", "removed")


class EngineWatch:
    """Follows the containers of one run by the engine's events, and by listing all of them every few seconds.

    An event only tells which container to inspect; every state comes from an inspection.

    Attributes:
        last_error: The reason of the last error of the engine; empty if there was none.

    Args:
        clock: Takes note of every event; it takes note of the client's answers by itself.
    """

    def __init__(self, client: DockerClient, place: RunPlace, clock: EngineClock) -> None:
        self.last_error = ""
        self._client = client
        self._clock = clock
        self._network = place.network
        self._label = f"{RUN_LABEL}={place.run_id}"
        self._states: dict[str, ContainerState] = {}
        # This lock lets threads inspect containers one after the other, so an old state never replaces a newer one.
        self._looking = threading.Lock()
        self._closed = threading.Event()
        self._stream: Any = None
        for target in (self._follow_events, self._keep_listing):
            threading.Thread(target=target, daemon=True).start()

    def state(self, container: str | None) -> ContainerState | None:
        """The last state of a container; None if there is none."""
        return None if container is None else self._states.get(container)

    def look(self, container: str) -> None:
        """Inspect a container."""
        with self._looking:
            try:
                self._states[container] = _state(self._client.api.inspect_container(container), self._network)
            except NotFound:
                self._states[container] = ContainerState("removed")

    def close(self) -> None:
        """Stop watching."""
        self._closed.set()
        if self._stream is not None:
            # The stream may end by itself at the same time.
            with suppress(AttributeError, *ENGINE_ERRORS):
                self._stream.close()

    def _follow_events(self) -> None:
        filters = {"type": "container", "label": self._label, "event": _EVENTS}
        while not self._closed.is_set():
            try:
                self._stream = self._client.events(decode=True, filters=filters)
                for event in self._stream:
                    self._clock.note_arrival()
                    self.look(event["id"])
            except ENGINE_ERRORS as error:
                self._note(error)
            self._closed.wait(_LOOK_EVERY_S)

    def _keep_listing(self) -> None:
        while not self._closed.wait(_LOOK_EVERY_S):
            try:
                listed = self._client.api.containers(all=True, filters={"label": self._label})
                now = {container["Id"]: container["State"] for container in listed}
                # `_states` is copied because the thread that follows the events may add a container meanwhile.
                before = {key: state.status for key, state in self._states.copy().items() if state.status != "removed"}
                for container in now.keys() | before.keys():
                    if now.get(container) != before.get(container):
                        self.look(container)
            except ENGINE_ERRORS as error:
                self._note(error)

    def _note(self, error: BaseException) -> None:
        # A timeout is no error to report: a stream without events times out, and the clock measures real silence.
        if not timed_out(error):
            self.last_error = in_words(error)


def _state(details: Mapping[str, Any], network: str) -> ContainerState:
    state = details["State"]
    attached = details["NetworkSettings"]["Networks"].get(network, {})
    return ContainerState(
        status=state["Status"],
        # The engine also gives exit code 0 to a container that runs or has never run.
        code=None if state["Running"] or state["Status"] == "created" else state["ExitCode"],
        out_of_memory=state["OOMKilled"],
        healthy=state.get("Health", {}).get("Status") == "healthy",
        address=attached.get("IPAddress") or None,
    )


class EngineClock:
    """Measures how long an engine has not answered any request of this process.

    Every answer to a client that was given to `attend` ends the silence, and so does everything that arrives on a
    stream. A thread counts the time in small steps, so that time in which this process itself was stopped does not
    count as silence.

    `silent_s` is the time since the engine last answered [s]. `warn` gets a line of text when that is long, and another
    when the engine answers again.
    """

    def __init__(self, warn: Callable[[str], None]) -> None:
        self.silent_s = 0.0
        self._warn = warn
        self._warned = False
        self._closed = threading.Event()
        threading.Thread(target=self._count, daemon=True).start()

    @property
    def given_up(self) -> bool:
        """Whether the engine has been silent for so long that this process no longer waits for it."""
        return self.silent_s >= SILENCE_S

    def attend(self, client: DockerClient) -> None:
        """Count every answer that a client gets."""
        client.api.hooks["response"].append(lambda *_, **__: self.note_arrival())

    def note_arrival(self) -> None:
        """Take note that something arrived, such as a part of a stream."""
        self.silent_s = 0.0

    def close(self) -> None:
        """Stop counting."""
        self._closed.set()

    def _count(self) -> None:
        while not self._closed.wait(_TICK_S):
            self.silent_s += _TICK_S
            if (self.silent_s >= _WARN_S) == self._warned:
                continue
            self._warned = not self._warned
            # The terminal may be closed by now; that error must not end the counting.
            with suppress(OSError, ValueError):
                self._warn(
                    f"the Docker engine has not answered for {self.silent_s:.0f} s; waiting"
                    if self._warned
                    else "the Docker engine answers again"
                )
