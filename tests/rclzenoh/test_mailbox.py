"""Waiting items in the mailbox of a node move with the node to another executor."""

from __future__ import annotations

from queue import SimpleQueue
from typing import Any

from rclzenoh.mailbox import Mailbox, Receiver, WorkQueue
from rclzenoh.task import submit


class Ear(Receiver):
    def handle(self, item: Any) -> None:
        del item


def drain(queue: WorkQueue) -> list[object]:
    return [queue.get_nowait() for _ in range(queue.qsize())]


def test_tasks_and_items_of_a_node_are_taken_back_from_its_executor() -> None:
    leaves, stays = Mailbox(), Mailbox()
    shared: WorkQueue = SimpleQueue()
    leaves.attach(shared)
    stays.attach(shared)
    first, other, ear = submit(leaves, lambda: None), submit(stays, lambda: None), Ear(leaves, None)
    ear.deliver("a")
    last = submit(leaves, lambda: None)
    leaves.detach()
    assert drain(shared) == [other]
    another: WorkQueue = SimpleQueue()
    leaves.attach(another)
    assert drain(another) == [first, ear, last]
