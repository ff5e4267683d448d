"""Throws as the page draws them, and the newest ones of a run, received by its bridge."""

from __future__ import annotations

import asyncio
import json
import struct
from collections.abc import AsyncGenerator, Callable, Mapping
from contextlib import suppress
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


def encode_throw(episode: Episode, simulation: str, values: Mapping[str, float], bodies: tuple[BodyLook, ...]) -> bytes:
    """Encode an episode for the page, with its simulation, its swept values by their dotted keys, and its bodies.

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
        "bodies": [asdict(body) for body in bodies],
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


def describe_trial(plan: Plan, trial: int) -> tuple[Mapping[str, float], tuple[BodyLook, ...]]:
    """Read the swept values of a trial, by dotted key, and its bodies."""
    planned = plan.trial(trial)
    return planned.values, looks_of(plan.config_of(planned))


async def hear_throws(run: Run, bridge: Bridge) -> AsyncGenerator[bytes]:
    """Encode the newest throws of a run as they come; who takes them slowly misses some."""
    loop = asyncio.get_running_loop()
    waiting: asyncio.Queue[tuple[str, bytes]] = asyncio.Queue(maxsize=1)
    feeds: dict[str, Callable[[], None]] = {}
    ends = False

    def put(simulation: str, message: bytes) -> None:
        if waiting.full():
            waiting.get_nowait()
        waiting.put_nowait((simulation, message))

    def hear(simulation: str, sample: Sample) -> None:
        # The loop may have ended, and with it the connection.
        with suppress(RuntimeError):
            loop.call_soon_threadsafe(put, simulation, sample.data)

    def listen() -> None:
        """Subscribe to all simulations, now and again, because some may be started later; the bridge calls this."""
        if ends:
            for stop in feeds.values():
                stop()
            return
        # A run that was forgotten has no simulations; clients see that in the state.
        with suppress(ThrowcollectError):
            for name in set(simulations_of(run.now().record.nodes)) - feeds.keys():
                topic = make_shown_topic(name)
                feeds[name] = bridge.listen(topic, "std_msgs/msg/UInt8MultiArray", partial(hear, name))
        bridge.later(_LOOK_S, listen)

    bridge.submit(listen)
    try:
        while True:
            if (frame := await asyncio.to_thread(_encode, run, *await waiting.get())) is not None:
                yield frame
    finally:
        ends = True


def _encode(run: Run, simulation: str, message: bytes) -> bytes | None:
    try:
        episode = unpack(message, Signer.of_key(run.key))
        if not isinstance(episode, Episode) or not episode.result:
            return None
        planned = describe_trial(read_plan(run.record.directory), episode.header.trial)
        return encode_throw(episode, simulation, *planned)
    except (ThrowcollectError, OSError):
        # Another node has published something else on this topic, or the dataset was removed.
        return None
