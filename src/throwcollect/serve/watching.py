"""Reads the state several times a second for all clients that want to be told of changes."""

from __future__ import annotations

import asyncio
import logging
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from dataclasses import replace

from throwcollect.errors import ThrowcollectError
from throwcollect.serve.state import STATES, WholeState

_LOOK_S = 0.2
_logger = logging.getLogger(__name__)


class StateWatch:
    """Reads the state as long as there are listeners, and sends them the whole state after each change.

    Args:
        look: Reads the state; called in another thread.
    """

    def __init__(self, look: Callable[[], WholeState]) -> None:
        self._look = look
        self._state: WholeState | None = None
        self._revision = 0
        self._changed = asyncio.Condition()
        self._one_look = asyncio.Lock()
        self._listeners = 0
        self._looking: asyncio.Task[None] | None = None

    async def current(self) -> WholeState:
        """Read the state.

        Raises:
            ConfigError: If runs cannot be remembered.
        """
        # Only one reads at a time, so that an older state never gets a higher revision than a newer one.
        async with self._one_look:
            state = await asyncio.to_thread(self._look)
            async with self._changed:
                if self._state is None or state != replace(self._state, revision=0):
                    self._revision += 1
                    self._state = replace(state, revision=self._revision)
                    self._changed.notify_all()
                return self._state

    async def states(self) -> AsyncIterator[bytes]:
        """The state as JSON, at first as it is and then after each change; a slow listener gets only the latest."""
        async with self._listening():
            state = await self.current()
            while True:
                yield STATES.dump_json(state)
                async with self._changed:
                    seen = state.revision
                    await self._changed.wait_for(lambda seen=seen: self._revision > seen)  # type: ignore[misc]
                    if self._state is not None:
                        state = self._state

    @asynccontextmanager
    async def _listening(self) -> AsyncIterator[None]:
        self._listeners += 1
        if self._looking is None:
            self._looking = asyncio.create_task(self._keep_looking())
        try:
            yield
        finally:
            self._listeners -= 1
            if not self._listeners and self._looking is not None:
                self._looking.cancel()
                self._looking = None

    async def _keep_looking(self) -> None:
        is_logged = False
        while True:
            await asyncio.sleep(_LOOK_S)
            try:
                await self.current()
            except (ThrowcollectError, OSError):
                # If records cannot be read for a while, such as on a full disk, listeners keep the last state.
                pass
            except Exception:
                # One error must not end this loop, which serves all listeners. One that lasts is logged only once.
                if not is_logged:
                    _logger.exception("the state cannot be read")
                is_logged = True
            else:
                is_logged = False
