"""Starts the container of one node, and copies its output into the log of the node."""

from __future__ import annotations

import threading
from collections.abc import Callable, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any

from docker.client import DockerClient
from docker.errors import NotFound
from docker.models.containers import Container

from throwcollect.files import open_log
from throwcollect.runtimes.docker.container_options import LOG_LABEL
from throwcollect.runtimes.docker.docker_engine import ENGINE_ERRORS, in_words
from throwcollect.runtimes.docker.watch import EngineClock

_AT_ONCE = threading.BoundedSemaphore(8)
"""Starting more containers at the same time was measured to gain nothing."""

LOG_S = 2.0
"""Time in which the last lines that a node printed arrive in its file."""
_RETRY_S = 1.0
_LIVELY = ("running", "paused", "restarting")


class NodeContainer:
    """A container, with a thread of its own that starts it and copies its output.

    Attributes:
        handle: Id of the container; None until it runs.
        failure: Reason why the container could not be started; None if there is none.

    Args:
        log: File to which the output of the container is appended.
        clock: Takes note of all output; it takes note of the client's answers by itself.
    """

    def __init__(self, client: DockerClient, name: str, log: Path, clock: EngineClock) -> None:
        self.name = name
        self.handle: str | None = None
        self.failure: str | None = None
        self._client = client
        self._log = log
        self._clock = clock
        self._begun = threading.Event()
        self._unwanted = threading.Event()
        self._closed = threading.Event()
        self._thread: threading.Thread | None = None

    @property
    def begun(self) -> bool:
        """Whether the start of the container has succeeded or failed."""
        return self._begun.is_set()

    @property
    def log_complete(self) -> bool:
        """Whether the container has ended, and all its output is in the file."""
        return self._thread is not None and not self._thread.is_alive()

    def start(self, options: dict[str, Any], *, networks: Sequence[str]) -> None:
        """Begin to start the container, and remove an ended container of the same name.

        `options` are keywords for `containers.create`. The container joins `networks` besides the network in `options`.
        """
        self._run_in_thread(lambda: self._start_and_copy_log(options, networks))

    def adopt(self, container: Container) -> None:
        """Take over a container that exists."""
        self.handle = container.id
        self._begun.set()
        offset = int(container.labels.get(LOG_LABEL, 0))
        self._run_in_thread(lambda: self._copy_log(container, offset))

    def wait_begun(self, timeout_s: float) -> bool:
        """Wait for `begun`, at most this time [s], and return its value."""
        return self._begun.wait(timeout_s)

    def renounce(self) -> None:
        """If the container is still being started, remove it as soon as it runs, because nobody needs it any more."""
        self._unwanted.set()

    def wait_log(self) -> None:
        """Wait for `log_complete`, at most the time in which the last lines arrive."""
        if self._thread is not None:
            self._thread.join(LOG_S)

    def end(self, grace_s: int) -> None:
        """End the container, after this time [s] by force, and remove it; it may be gone, or never have begun."""
        if self.handle is None:
            return
        with suppress(*ENGINE_ERRORS):
            self._client.api.stop(self.handle, timeout=grace_s)
            self.wait_log()
            self._client.api.remove_container(self.handle, v=True, force=True)

    def close(self) -> None:
        """Stop copying output at the next error of the engine or the end of a stream."""
        self._closed.set()

    def _run_in_thread(self, work: Callable[[], None]) -> None:
        self._thread = threading.Thread(target=work, daemon=True)
        self._thread.start()

    def _start_and_copy_log(self, options: dict[str, Any], networks: Sequence[str]) -> None:
        """Start the container, and copy its output until it has ended."""
        container = None
        try:
            with _AT_ONCE:
                # `renounce` may have been called while this thread waited.
                if self._unwanted.is_set():
                    return
                with suppress(NotFound):
                    self._client.api.remove_container(options["name"], v=True, force=True)
                # A launcher that adopts the container has to know where in the file its output begins.
                with open(open_log(self._log), "ab") as log:
                    offset = log.tell()
                labels = {**options["labels"], LOG_LABEL: str(offset)}
                container = self._client.containers.create(**{**options, "labels": labels})
                for network in networks:
                    self._client.networks.get(network).connect(container)
                container.start()
                self.handle = container.id
        except ENGINE_ERRORS as error:
            self.failure = in_words(error)
            if container is not None:
                with suppress(*ENGINE_ERRORS):
                    container.remove(v=True, force=True)
            return
        finally:
            self._begun.set()
        if self._unwanted.is_set():
            with suppress(*ENGINE_ERRORS):
                container.remove(v=True, force=True)
            return
        self._copy_log(container, offset)

    def _copy_log(self, container: Container, offset: int) -> None:
        """Append the output of the container to the log file until the container has ended.

        The output begins at `offset` in the file. Output that is in the file already is not written again.
        """
        with open(open_log(self._log), "ab", buffering=0) as log:
            while not self._closed.is_set():
                try:
                    known = log.tell() - offset
                    for chunk in container.logs(stream=True, follow=True):
                        self._clock.note_arrival()
                        # Each stream repeats the output from its first byte, so `known` bytes are skipped.
                        log.write(chunk[known:])
                        known = max(0, known - len(chunk))
                    # A stream also ends when the engine ends, so only the state tells whether more output can come.
                    container.reload()
                    if container.status not in _LIVELY:
                        return
                except NotFound:
                    return
                except ENGINE_ERRORS:
                    # The engine may come back soon, and the container may still run.
                    self._closed.wait(_RETRY_S)
