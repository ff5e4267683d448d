"""The newest throws of a run, as the page draws them: received by the bridge of the run while there are watchers."""

from __future__ import annotations

import asyncio
import json
import struct
from collections.abc import AsyncIterator, Awaitable, Callable, Mapping
from contextlib import asynccontextmanager, suppress
from dataclasses import asdict
from functools import lru_cache, partial
from pathlib import Path

import numpy as np

from throwcollect.collect.coordinator_node.preview import make_shown_topic
from throwcollect.collect.runs.run import Run
from throwcollect.config.loader import load
from throwcollect.dataset.directory import PLAN, config_path
from throwcollect.episode.episode_message import Episode, unpack
from throwcollect.errors import ThrowcollectError
from throwcollect.plan.plan import Plan
from throwcollect.robots.surroundings import BodyLook, looks_of
from throwcollect.run_key import Signer
from throwcollect.serve.rosbridge import Bridge
from throwcollect.serve.rosbridge.bridge import Sample
from throwcollect.serve.state import simulations_of
from throwcollect.units import NS_PER_S

_LOOK_S = 0.5
_FLOAT_BYTES = 4
_LENGTH = struct.Struct("<I")
_ENDS = ("landing", "rest")
"""Instants at whose place the object ended; the first one that a result has counts."""


def encode_throw(
    episode: Episode, simulation: str, values: Mapping[str, float], bodies: tuple[BodyLook, ...] | None
) -> bytes:
    """Encode an episode for the page, with the name of its simulation and the swept values by their dotted keys.

    The bodies are those of this trial, or None if they are not known.

    Returns:
        Length of a JSON header as uint32, the header, zero bytes up to a multiple of four, then float32: angles of the
        joints [rad], shape ``(n_samples, n_joints)``, the object's centre in world [m], shape ``(n_samples, 3)``, and
        centres and quaternions of the bodies that move, with the object last, shape ``(n_samples, n_moving, 7)``; all
        little-endian. The header has ``trial``, ``simulation``, ``outcome``, ``joints``, ``samples``, ``rate_hz``,
        ``landing``, ``values`` and ``bodies``.
    """
    samples = episode.samples()
    result = json.loads(episode.result)
    spacing_ns = int(samples.stamps_ns[1] - samples.stamps_ns[0]) if len(samples) > 1 else NS_PER_S
    places = ([result.get(f"{end}_{axis}_m") for axis in "xyz"] for end in _ENDS)
    header = {
        "trial": episode.header.trial,
        "simulation": simulation,
        "outcome": result["outcome"],
        "joints": episode.table.joints,
        "samples": len(samples),
        "rate_hz": NS_PER_S / spacing_ns,
        "landing": next((place for place in places if None not in place), None),
        "values": dict(values),
        "bodies": None if bodies is None else [asdict(body) for body in bodies],
    }
    text = json.dumps(header).encode()
    # In JavaScript, a typed array has to begin at a multiple of the size of its numbers.
    padding = b"\0" * (-(_LENGTH.size + len(text)) % _FLOAT_BYTES)
    moving = (*range(1, samples.bodies.shape[1] + 1), 0)
    poses = np.hstack([part for number in moving for part in samples.parts_of(number)[:2]])
    numbers = (samples.position, samples.object_position, poses)
    return b"".join((_LENGTH.pack(len(text)), text, padding, *(part.astype("<f4").tobytes() for part in numbers)))


def read_plan(directory: Path) -> Plan:
    """Read the plan of a dataset, unless it was read before and has not grown since."""
    return _read_plan(directory, (directory / PLAN).stat().st_mtime_ns)


@lru_cache(maxsize=4)
def _read_plan(directory: Path, _changed_ns: int) -> Plan:
    return Plan.read(directory / PLAN, load(config_path(directory)))


def describe_trial(directory: Path, trial: int) -> tuple[Mapping[str, float], tuple[BodyLook, ...] | None]:
    """Swept values of a trial, by dotted key, and its bodies; none if the plan cannot be read on this machine."""
    try:
        planned = (plan := read_plan(directory)).trial(trial)
        return planned.values, looks_of(plan.config_of(planned))
    except (ThrowcollectError, OSError, IndexError):
        return {}, None


class ThrowWatch:
    """Receives the newest throws of one run by its bridge, while there are listeners."""

    def __init__(self, run: Run, bridge: Bridge) -> None:
        self._run = run
        self._bridge = bridge
        self._loop = asyncio.get_running_loop()
        self._queues: list[asyncio.Queue[bytes]] = []
        self._newest: bytes | None = None
        self._feeds: dict[str, Callable[[], None]] = {}
        """What ends the subscription to each simulation."""
        self._is_on = False

    @asynccontextmanager
    async def throws(self) -> AsyncIterator[Callable[[], Awaitable[bytes]]]:
        """Listen as long as the block lasts.

        Yields:
            A function that returns the newest throw since its last call, and waits for one if none has come.
        """
        queue: asyncio.Queue[bytes] = asyncio.Queue(maxsize=1)
        self._queues.append(queue)
        self._bridge.submit(self._begin)
        if self._newest is not None:
            queue.put_nowait(self._newest)
        try:
            yield queue.get
        finally:
            self._queues.remove(queue)

    def _begin(self) -> None:
        if not self._is_on:
            self._is_on = True
            self._listen()

    def _listen(self) -> None:
        """Subscribe to all simulations of the run, now and again, because some may be started later."""
        if not self._queues:
            for stop in self._feeds.values():
                stop()
            self._feeds, self._newest, self._is_on = {}, None, False
            return
        # A run that was forgotten has no simulations; clients see that in the state.
        with suppress(ThrowcollectError):
            for name in set(simulations_of(self._run.now().record.nodes)) - self._feeds.keys():
                self._feeds[name] = self._bridge.listen(
                    make_shown_topic(name), "std_msgs/msg/UInt8MultiArray", partial(self._hear, name)
                )
        self._bridge.later(_LOOK_S, self._listen)

    def _hear(self, simulation: str, sample: Sample) -> None:
        asyncio.run_coroutine_threadsafe(self._pass_on(simulation, sample.data), self._loop)

    async def _pass_on(self, simulation: str, message: bytes) -> None:
        """Put a throw into all queues, in the place of one that was not taken yet."""
        frame = await asyncio.to_thread(self._encode, simulation, message)
        if frame is None:
            return
        self._newest = frame
        for queue in self._queues:
            while not queue.empty():
                queue.get_nowait()
            queue.put_nowait(frame)

    def _encode(self, simulation: str, message: bytes) -> bytes | None:
        try:
            episode = unpack(message, Signer.of_key(self._run.key))
            if not isinstance(episode, Episode) or not episode.result:
                return None
            planned = describe_trial(self._run.record.directory, episode.header.trial)
            return encode_throw(episode, simulation, *planned)
        except ThrowcollectError:
            # Another node has published something else on this topic.
            return None
