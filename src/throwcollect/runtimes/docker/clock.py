"""How long a Docker engine has been silent."""

from __future__ import annotations

import threading
from collections.abc import Callable
from contextlib import suppress
from typing import Any

from docker.client import DockerClient

_TICK_S = 0.5
_TELL_S = 15.0
"""A busy engine takes some seconds for an answer now and then, which nobody needs to know."""


class EngineClock:
    """Measures how long an engine has answered nothing of all that this process asks it.

    Every answer counts, whoever asked and whatever it says, and so does everything that arrives on a stream. The time
    is counted by a thread in small steps, so that time in which this process itself was stopped is not taken for
    silence of the engine.

    Args:
        warn: Is told in one line when the engine has been silent for long, and when it answers again.
    """

    def __init__(self, warn: Callable[[str], None]) -> None:
        self._warn = warn
        self._silent_s = 0.0
        self._told = False
        self._closed = threading.Event()
        threading.Thread(target=self._count, daemon=True).start()

    @property
    def silent_s(self) -> float:
        """Time since the engine last answered [s]."""
        return self._silent_s

    def attend(self, client: DockerClient) -> None:
        """Count every answer that a client gets."""
        client.api.hooks["response"].append(self._note_answer)

    def ignore(self, client: DockerClient) -> None:
        """Count the answers that a client gets no more."""
        with suppress(ValueError):
            client.api.hooks["response"].remove(self._note_answer)

    def note_arrival(self) -> None:
        """Take note of something that arrived, such as a part of a stream."""
        self._silent_s = 0.0

    def close(self) -> None:
        """Stop counting."""
        self._closed.set()

    def _note_answer(self, _response: Any, *_: Any, **__: Any) -> None:
        self.note_arrival()

    def _count(self) -> None:
        while not self._closed.wait(_TICK_S):
            self._silent_s += _TICK_S
            if self._silent_s >= _TELL_S and not self._told:
                self._told = True
                self._tell(f"the Docker engine has not answered for {self._silent_s:.0f} s; waiting")
            elif self._silent_s < _TELL_S and self._told:
                self._told = False
                self._tell("the Docker engine answers again")

    def _tell(self, line: str) -> None:
        # Whoever listened may have gone; the time must be counted all the same.
        with suppress(OSError, ValueError):
            self._warn(line)
