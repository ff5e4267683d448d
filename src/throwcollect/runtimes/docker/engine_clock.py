"""Measures how long a Docker engine has been silent."""

from __future__ import annotations

import threading
from collections.abc import Callable
from contextlib import suppress

from docker.client import DockerClient

SILENCE_S = 120.0
"""An engine that is silent for this long is given up; a busy engine may let a request wait for half a minute."""
_TICK_S = 0.5
_WARN_S = 15.0
"""The user is warned of a longer silence; a busy engine often takes some seconds for an answer."""


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
