"""Logs how far long work has come, so that users who wait see that it goes on; commands print what is logged here."""

from __future__ import annotations

import logging
import time
from collections.abc import Iterable, Iterator
from typing import TypeVar

from throwcollect.wording import format_count

LOGGER = "throwcollect.progress"
"""Name of the logger, which gets a record of the level INFO for each line."""
_EVERY_S = 2.0
_Item = TypeVar("_Item")


class ProgressLog:
    """Logs how many of some things are done, every two seconds; nothing of work that takes less.

    Args:
        count: How many things there are.
        noun: What they are, such as ``trial``.
        done: What is done with them, such as ``exported``.
    """

    def __init__(self, count: int, noun: str, done: str) -> None:
        self._count = count
        self._words = f"of {format_count(count, noun)} {done}"
        self._last_s = time.monotonic()

    def note(self, number: int) -> None:
        """Note that so many things are done."""
        now = time.monotonic()
        if now >= self._last_s + _EVERY_S and number < self._count:
            self._last_s = now
            logging.getLogger(LOGGER).info("%d %s", number, self._words)


def log_progress(items: Iterable[_Item], count: int, noun: str, done: str) -> Iterator[_Item]:
    """Pass items on, and log how many are done; the arguments are those of `ProgressLog`."""
    log = ProgressLog(count, noun, done)
    for number, item in enumerate(items, start=1):
        yield item
        log.note(number)
