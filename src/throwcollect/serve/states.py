"""Reads the state of all runs, for requests and for all clients that follow it."""

from __future__ import annotations

import asyncio
import math
import time
from collections.abc import AsyncIterator
from contextlib import suppress
from dataclasses import replace

from throwcollect.collect.runs.records import Records
from throwcollect.collect.runs.run import Run
from throwcollect.errors import ConfigError, ThrowcollectError
from throwcollect.serve.catalogue import Catalogue
from throwcollect.serve.state import ComponentState, InstanceState, WholeState, describe

_LOOK_S = 0.2
_FRESH_S = 0.1
"""Clients that follow the state get one that is not older."""
_MOST_OVER = 100


class States:
    """Reads the state; the record of a run that has ended is read again only if it was written since."""

    def __init__(self, catalogue: Catalogue) -> None:
        self._catalogue = catalogue
        self._ended: dict[tuple[str, int | None], Run] = {}
        self._state = WholeState([], [])
        self._read_at = -math.inf
        self._one_look = asyncio.Lock()

    def list_instances(self) -> list[InstanceState]:
        """All runs that this machine remembers, the latest first."""
        return _describe_all(self._read_runs())

    async def read(self, oldest_s: float = 0.0) -> WholeState:
        """Read the state, or return the last one if it is not older than this [s].

        Raises:
            ConfigError: If runs cannot be remembered.
        """
        # Only one reads at a time, so that an older state never gets a higher revision than a newer one.
        async with self._one_look:
            if time.monotonic() >= self._read_at + oldest_s:
                state = await asyncio.to_thread(self._look)
                self._read_at = time.monotonic()
                if replace(self._state, revision=0) != state:
                    self._state = replace(state, revision=self._state.revision + 1)
            return self._state

    async def follow(self) -> AsyncIterator[WholeState]:
        """The state as it is, and then after each change; a slow client gets only the latest."""
        revision = 0
        while True:
            # If records cannot be read for a while, such as on a full disk, clients keep the last state.
            with suppress(ThrowcollectError, OSError):
                state = await self.read(_FRESH_S)
                if state.revision != revision:
                    revision = state.revision
                    yield state
            await asyncio.sleep(_LOOK_S)

    def _look(self) -> WholeState:
        """All runs that live, and the latest of those that are over."""
        runs = self._read_runs()
        over = [run for run in runs if run.status != "running"]
        instances = _describe_all([run for run in runs if run.status == "running"] + over[:_MOST_OVER])
        living = [each for each in instances if each.status not in ("ended", "died")]
        components = [
            ComponentState(
                each.name,
                each.pretty_name,
                each.kind,
                each.max_instances,
                [instance.id for instance in living if instance.component == each.name],
            )
            for each in self._catalogue.components.values()
        ]
        return WholeState(components, instances)

    def _read_runs(self) -> list[Run]:
        records = Records()
        runs, ended = [], {}
        for name in records.ids():
            written = name, records.read_change_ns(name)
            # A record that was removed just now or is damaged is left out; `throwcollect ps` reports damaged ones.
            with suppress(ConfigError):
                run = self._ended[written] if written in self._ended else records.get(name)
                runs.append(run)
                if run.status == "ended":
                    ended[written] = run
        self._ended = ended
        return sorted(runs, key=lambda run: run.record.started, reverse=True)


def _describe_all(runs: list[Run]) -> list[InstanceState]:
    # A dataset that another run continues right now cannot be resumed.
    growing = {run.record.directory for run in runs if run.status == "running"}
    return [describe(run, is_growing=run.record.directory in growing) for run in runs]
