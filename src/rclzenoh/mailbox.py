"""Queues that carry what arrives from Zenoh to the thread that spins.

Zenoh's threads only put the raw item into the receiver's queue and the receiver into the mailbox of its node, which is
one queue for all receivers of all nodes of an executor. So an executor that waits wakes at once, items are handled in
their order of arrival across topics and services, and looking for work costs next to nothing when there is none.
"""

from __future__ import annotations

import threading
from abc import ABC, abstractmethod
from collections import deque
from collections.abc import Callable
from queue import SimpleQueue
from typing import Any

WorkQueue = SimpleQueue[Callable[[], bool] | None]
"""Work in order of arrival, which returns False if there was nothing to do after all; None only wakes the executor."""


class Mailbox:
    """The queue of a node's work; while the node is in an executor, it is the queue of that executor."""

    def __init__(self) -> None:
        # The lock is reentrant, because the garbage collector may close a query while the lock is held, which delivers.
        self.lock = threading.RLock()
        # This must not be a `Queue`: the handler of a signal may wake the executor in the middle of another `put`.
        self.queue: WorkQueue = SimpleQueue()

    def submit(self, work: Callable[[], bool] | None) -> None:
        """Give work to the thread that spins; None only wakes it."""
        with self.lock:
            self.queue.put(work)

    def attach(self, queue: WorkQueue) -> None:
        """Deliver to the queue of an executor from now on, and move the work that waits to it."""
        with self.lock:
            while not self.queue.empty():
                queue.put(self.queue.get())
            self.queue = queue

    def detach(self) -> None:
        """Deliver to a queue of its own again; the executor still does the work that it has."""
        with self.lock:
            self.queue = SimpleQueue()


class Receiver(ABC):
    """Gets items from Zenoh and handles them when its executor spins.

    Args:
        mailbox: Mailbox of the node.
        queue_length: Largest number of waiting items; if there are more, the oldest is dropped. None keeps all.
    """

    def __init__(self, mailbox: Mailbox, queue_length: int | None) -> None:
        self.mailbox = mailbox
        self._queue_length = queue_length
        self._items: deque[Any] = deque()

    def deliver(self, item: Any) -> None:
        """Take an item, in any thread."""
        with self.mailbox.lock:
            if len(self._items) == self._queue_length:
                # The oldest item makes room. This receiver is in the mailbox once for each item, and takes the entry of
                # the oldest item for the new one.
                self._items.popleft()
            else:
                self.mailbox.queue.put(self._handle_oldest)
            self._items.append(item)

    def _handle_oldest(self) -> bool:
        with self.mailbox.lock:
            if not self._items:
                return False
            item = self._items.popleft()
        self.handle(item)
        return True

    @abstractmethod
    def handle(self, item: Any) -> None:
        """Handle one item, in the thread that spins."""

    def take_all(self) -> list[Any]:
        """Take out all items that wait."""
        with self.mailbox.lock:
            items, self._items = list(self._items), deque()
        return items
