"""One bridge for each run that somebody is connected to by rosbridge, as long as anybody is."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator, Mapping
from contextlib import asynccontextmanager, suppress
from dataclasses import dataclass
from pathlib import Path

from throwcollect.config.loader import load
from throwcollect.dataset.directory import config_path
from throwcollect.errors import ConflictError, ThrowcollectError
from throwcollect.robots.description import robot_of
from throwcollect.ros.connection import Connection
from throwcollect.runs.records import Run
from throwcollect.serve.rosbridge import Bridge, find_packages

_MOST_CLIENTS = 16
_LOOK_S = 0.5


@dataclass
class _Shared:
    bridge: Bridge
    following: asyncio.Task[None]
    clients: int = 0


class Bridges:
    """Counts the clients of each bridge."""

    def __init__(self) -> None:
        self._shared: dict[str, _Shared] = {}

    @asynccontextmanager
    async def bridge(self, run: Run) -> AsyncIterator[Bridge]:
        """The bridge of a run, for one more client.

        Args:
            run: The run.

        Raises:
            ConflictError: If as many clients as there may be are connected, to all runs together.
            ConfigError: If the files of the robot cannot be found.
        """
        if sum(each.clients for each in self._shared.values()) >= _MOST_CLIENTS:
            raise ConflictError(f"{_MOST_CLIENTS} clients are connected by rosbridge, as many as there may be")
        if (shared := self._shared.get(run.id)) is None:
            run.record.middleware.joining.settle()
            bridge = Bridge(run.connection, await asyncio.to_thread(_find_packages, run))
            shared = self._shared[run.id] = _Shared(bridge, asyncio.create_task(_follow(run, bridge)))
        shared.clients += 1
        try:
            yield shared.bridge
        finally:
            shared.clients -= 1
            if not shared.clients:
                del self._shared[run.id]
                shared.following.cancel()
                await asyncio.to_thread(shared.bridge.close)


def _find_packages(run: Run) -> Mapping[str, Path]:
    """Packages of the robot of a run; none while it has no configuration yet."""
    path = config_path(run.place.directory)
    return find_packages(robot_of(load(path))) if path.is_file() else {}


async def _follow(run: Run, bridge: Bridge) -> None:
    """Tell a bridge where the router of its run is, whenever that changes."""
    known = run.connection
    while True:
        await asyncio.sleep(_LOOK_S)
        connection: Connection | None = None
        # A run that was forgotten has no router either.
        with suppress(ThrowcollectError):
            connection = (await asyncio.to_thread(run.now)).connection
        if connection != known:
            known = connection
            bridge.move(connection)
