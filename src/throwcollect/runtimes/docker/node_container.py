"""The container of one node, from its creation to the last line of its log."""

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
from throwcollect.runtimes.docker.clock import EngineClock
from throwcollect.runtimes.docker.engine import ENGINE_ERRORS, in_words
from throwcollect.runtimes.docker.options import LOG_LABEL

_AT_ONCE = threading.BoundedSemaphore(8)
"""More containers started at the same time were not up any sooner."""

_RETRY_S = 1.0
_LIVELY = ("running", "paused", "restarting")


class NodeContainer:
    """A container that is started and whose output is copied by a thread of its own.

    Attributes:
        name: Name of the node.
        handle: Id of the container; None until it runs.
        failure: Why it could not be started; None if it could.

    Args:
        client: Client of the engine.
        name: Name of the node.
        log: File to which its output is appended.
        clock: Is told of all that it prints; it counts the client's answers by itself.
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
        """Whether it has been started, or could not be."""
        return self._begun.is_set()

    @property
    def log_complete(self) -> bool:
        """Whether all that it will ever print is in its file."""
        return self._thread is not None and not self._thread.is_alive()

    def start(self, options: dict[str, Any], *, networks: Sequence[str]) -> None:
        """Begin to start it; an ended container of its name is removed.

        Args:
            options: Keywords for `containers.create`.
            networks: Networks that it joins besides.
        """
        self._run_in_thread(lambda: self._live(options, networks))

    def adopt(self, container: Container) -> None:
        """Take over a container that exists."""
        self.handle = container.id
        self._begun.set()
        offset = int(container.labels.get(LOG_LABEL, 0))
        self._run_in_thread(lambda: self._copy_log(container, offset))

    def wait_begun(self, timeout_s: float) -> bool:
        """Wait until it runs or could not be started, at most so long [s]; whether either is so."""
        return self._begun.wait(timeout_s)

    def renounce(self) -> None:
        """Let it end as soon as it runs, if it is still being started: nobody waits for it any more."""
        self._unwanted.set()

    def wait_log(self, timeout_s: float) -> None:
        """Wait until its output is in its file, at most so long [s]."""
        if self._thread is not None:
            self._thread.join(timeout_s)

    def close(self) -> None:
        """Copy nothing more once the engine fails."""
        self._closed.set()

    def _run_in_thread(self, work: Callable[[], None]) -> None:
        self._thread = threading.Thread(target=work, daemon=True)
        self._thread.start()

    def _live(self, options: dict[str, Any], networks: Sequence[str]) -> None:
        container = None
        try:
            with _AT_ONCE:
                # It may have been asked to end while it waited for its turn.
                if self._unwanted.is_set():
                    return
                with suppress(NotFound):
                    self._client.api.remove_container(options["name"], v=True, force=True)
                # A launcher that takes over copies the log on from here, so the place is kept with the container.
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
        """Append what it prints to its file until it has ended and all is there.

        Args:
            container: The container.
            offset: Where in the file its output begins; what is there already is not written again.
        """
        with open(open_log(self._log), "ab", buffering=0) as log:
            while not self._closed.is_set():
                try:
                    known = log.tell() - offset
                    for chunk in container.logs(stream=True, follow=True):
                        self._clock.note_arrival()
                        log.write(chunk[known:])
                        known = max(0, known - len(chunk))
                    container.reload()
                    if container.status not in _LIVELY:
                        return
                except NotFound:
                    return
                except ENGINE_ERRORS:
                    # The engine may be back soon, with the container still running.
                    self._closed.wait(_RETRY_S)
