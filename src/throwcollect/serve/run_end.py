"""The end of a run, after which its sockets have nothing more to say."""

from __future__ import annotations

import asyncio

from throwcollect.errors import NotFoundError
from throwcollect.runs.records import Run

_LOOK_S = 1.0


def refuse_ended(run: Run) -> None:
    """Refuse a run that has ended, so that nobody would ever answer."""
    if run.status == "ended":
        raise NotFoundError(f"run {run.id} has ended")


async def wait_for_end(run: Run) -> None:
    """Wait until a run has ended, which is told by an error.

    Raises:
        NotFoundError: If the run has ended, or was forgotten.
        ConfigError: If its record is damaged.
    """
    while True:
        refuse_ended(await asyncio.to_thread(run.now))
        await asyncio.sleep(_LOOK_S)
