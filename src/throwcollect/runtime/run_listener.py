"""A way into the ROS graph of a run, for its launcher and for everybody who follows it."""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Iterator
from types import TracebackType

from throwcollect import ros
from throwcollect.coordinator.progress import Progress
from throwcollect.coordinator.progress_topic import ProgressListener
from throwcollect.errors import ConfigError, ThrowcollectError
from throwcollect.ros.endpoint import answers
from throwcollect.ros.middleware import Middleware
from throwcollect.run_key import RunKey
from throwcollect.runtime.nodes import node_environment
from throwcollect.runtime.records import Records, Run

_POLL_S = 0.05
_SILENT_S = 8.0
"""Reports come several times a second; after a silence like this the connection is made anew, should it be broken."""


class RunListener:
    """Hears the progress of a run, and moves along when its router gets another address; use it as a context manager.

    Args:
        on_progress: Called with every report, within `spin`.
        domain_id: ROS domain of the run.
        key: Key of the run.
        middleware: What carries the run's messages; that of this process.
        name: Name of the node; one of this process alone, and hidden, by default.
        on_connect: Called with the node whenever it is made anew.
    """

    def __init__(
        self,
        on_progress: Callable[[Progress], None],
        *,
        domain_id: int,
        key: RunKey,
        middleware: Middleware,
        name: str | None = None,
        on_connect: Callable[[ros.Node], None] = lambda _: None,
    ) -> None:
        self._on_progress = on_progress
        self._domain_id = domain_id
        self._key = key
        self._middleware = middleware
        self._name = name
        self._on_connect = on_connect
        self._listener: ProgressListener | None = None
        self._endpoint: str | None = None
        self._heard_at = 0.0

    def __enter__(self) -> RunListener:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self._listener is not None:
            self._listener.__exit__(None, None, None)
            self._listener = None

    def spin(self, endpoint: str | None, seconds: float) -> None:
        """Wait for a report, or for the router.

        Args:
            endpoint: Where the router is by now; None while it has no address.
            seconds: Longest time [s].

        Raises:
            ConfigError: If a variable of the environment does not hold what it should.
        """
        elsewhere = endpoint != self._endpoint or time.monotonic() > self._heard_at + _SILENT_S
        if endpoint is not None and elsewhere and answers(endpoint):
            self.__exit__(None, None, None)
            self._connect(endpoint)
        if self._listener is not None:
            self._listener.spin(seconds)
        else:
            time.sleep(seconds)

    def _connect(self, endpoint: str) -> None:
        os.environ.update(node_environment(endpoint, self._domain_id, self._key, self._middleware))
        self._heard_at = time.monotonic()
        try:
            listener = ProgressListener(self._hear, name=self._name)
        except ConfigError:
            raise
        except ThrowcollectError:
            # It answered a moment ago, so it has just ended; the next attempt finds its successor.
            return
        self._listener, self._endpoint = listener, endpoint
        self._on_connect(listener.node)

    def _hear(self, progress: Progress) -> None:
        self._heard_at = time.monotonic()
        self._on_progress(progress)


def follow(
    records: Records, run: str, *, on_progress: Callable[[Progress], None], keep_on: Callable[[], bool]
) -> Iterator[Run]:
    """Listen to a run until it ends.

    Args:
        records: All runs.
        run: Id of the run.
        on_progress: Called with every report of its coordinator.
        keep_on: Asked again and again whether to listen on.

    Yields:
        The run, as it is by then, several times a second; the last one has ended or died, unless `keep_on` refused.

    Raises:
        ConfigError: If its record vanishes or cannot be read.
    """
    found = records.get(run)
    record = found.record
    listener = RunListener(on_progress, domain_id=record.domain_id, key=found.key, middleware=record.middleware)
    with listener:
        yield found
        while found.status == "running" and keep_on():
            listener.spin(found.record.endpoint, _POLL_S)
            found = records.get(run)
            yield found
