"""Frames of one client that wait until the bridge handles them."""

from __future__ import annotations

import threading
from collections import deque

from throwcollect.serve.rosbridge.codec import Frame

_MOST_FRAMES = 1000
_MOST_BYTES = 32 * 2**20
"""Limits of frames that wait while the run has no router."""


class Inbox:
    """A queue of frames, which any thread may use."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._frames: deque[Frame] = deque()
        self._bytes = 0

    def __len__(self) -> int:
        return len(self._frames)

    @property
    def is_full(self) -> bool:
        """Whether the frames that wait have reached a limit; who must not lose a frame may add it nevertheless."""
        return len(self._frames) >= _MOST_FRAMES or self._bytes >= _MOST_BYTES

    def put(self, frame: Frame) -> None:
        """Add a frame."""
        with self._lock:
            self._frames.append(frame)
            self._bytes += len(frame)

    def take(self) -> Frame:
        """Take the oldest frame."""
        with self._lock:
            frame = self._frames.popleft()
            self._bytes -= len(frame)
            return frame

    def clear(self) -> None:
        """Forget all frames."""
        with self._lock:
            self._frames.clear()
            self._bytes = 0
