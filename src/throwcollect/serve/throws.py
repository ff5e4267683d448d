"""The newest throws of a run, as the page draws them: received in the run's graph as long as somebody watches."""

from __future__ import annotations

import asyncio
import json
import struct
import threading
from collections.abc import AsyncIterator, Awaitable, Callable, Iterable, Mapping
from contextlib import asynccontextmanager
from dataclasses import asdict
from functools import partial
from pathlib import Path

import numpy as np

from throwcollect.config.loader import load
from throwcollect.dataset.directory import PLAN, config_path
from throwcollect.episode.episode_message import Episode, unpack
from throwcollect.errors import ThrowcollectError
from throwcollect.robots.surroundings import BodyLook, looks_of
from throwcollect.ros import Node
from throwcollect.ros.msg import UInt8MultiArray
from throwcollect.ros.nodes.coordinator.showing import SHOWN_QOS, make_shown_topic
from throwcollect.run_key import Signer
from throwcollect.runs.run import Run
from throwcollect.runtimes.run_listener import RunListener
from throwcollect.serve.state import simulations_of
from throwcollect.sweep.plan import Plan
from throwcollect.units import NS_PER_S

_SPIN_S = 0.2
_FLOAT_BYTES = 4
_LENGTH = struct.Struct("<I")
_ENDS = ("landing", "rest")
"""Instants that say where the object ended; the first one that a result has counts."""


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


class PlannedTrials:
    """Values and bodies of the trials of a run; its plan is read when first needed, and when it has grown."""

    def __init__(self, directory: Path) -> None:
        self._directory = directory
        self._plan: Plan | None = None

    def of(self, trial: int) -> tuple[Mapping[str, float], tuple[BodyLook, ...] | None]:
        """Swept values of a trial, by dotted key, and its bodies; none if the plan cannot be read on this machine."""
        try:
            if self._plan is None or trial not in self._plan.trials.numbers:
                self._plan = Plan.read(self._directory / PLAN, load(config_path(self._directory)))
            planned = self._plan.trial(trial)
            return planned.values, looks_of(self._plan.config_of(planned))
        except (ThrowcollectError, IndexError):
            return {}, None


class ThrowWatch:
    """Receives the newest throws of one run in a thread of its own, while there are listeners."""

    def __init__(self, run: Run) -> None:
        self._run = run
        self._listeners: dict[asyncio.Queue[bytes], asyncio.AbstractEventLoop] = {}
        self._is_over = threading.Event()
        self._newest: bytes | None = None
        self._planned = PlannedTrials(run.context.directory)

    @asynccontextmanager
    async def throws(self) -> AsyncIterator[Callable[[], Awaitable[bytes]]]:
        """Listen as long as the block lasts.

        Yields:
            A function that returns the newest throw since its last call, and waits for one if none has come.
        """
        queue: asyncio.Queue[bytes] = asyncio.Queue(maxsize=1)
        if not self._listeners:
            # Each thread gets an event of its own, because the event of a new thread must not keep an old one alive.
            self._is_over = threading.Event()
            name = f"throws of {self._run.id}"
            threading.Thread(target=self._listen, args=(self._is_over,), name=name, daemon=True).start()
        self._listeners[queue] = asyncio.get_running_loop()
        if self._newest is not None:
            queue.put_nowait(self._newest)
        try:
            yield queue.get
        finally:
            del self._listeners[queue]
            if not self._listeners:
                self._is_over.set()

    @property
    def is_idle(self) -> bool:
        """Whether nobody listens."""
        return not self._listeners

    def _listen(self, is_over: threading.Event) -> None:
        run = self._run
        subscriptions = _Subscriptions(self._hear)
        with RunListener(lambda _: None, on_connect=subscriptions.move) as listener:
            while not is_over.is_set():
                try:
                    run = run.now()
                    if run.connection is not None:
                        run.record.middleware.joining.settle()
                    subscriptions.add(simulations_of(run.record.nodes))
                    listener.spin(run.connection, _SPIN_S)
                except ThrowcollectError:
                    # The run was forgotten, or cannot be joined; clients see that in the state.
                    is_over.wait(_SPIN_S)

    def _hear(self, simulation: str, message: bytes) -> None:
        try:
            episode = unpack(message, Signer.of_key(self._run.key))
            if not isinstance(episode, Episode) or not episode.result:
                return
            frame = encode_throw(episode, simulation, *self._planned.of(episode.header.trial))
        except ThrowcollectError:
            # Another node has published something else on this topic.
            return
        self._newest = frame
        for queue, loop in list(self._listeners.items()):
            loop.call_soon_threadsafe(_replace, queue, frame)


class _Subscriptions:
    """Subscribes to all simulations of a run, including those that are started later.

    Args:
        hear: Called with the name of a simulation and the message that carries its newest episode.
    """

    def __init__(self, hear: Callable[[str, bytes], None]) -> None:
        self._hear = hear
        self._node: Node | None = None
        self._heard: set[str] = set()

    def move(self, node: Node) -> None:
        """Subscribe again with another node."""
        self._node = node
        heard, self._heard = self._heard, set()
        self.add(heard)

    def add(self, simulations: Iterable[str]) -> None:
        """Subscribe to those simulations that are not subscribed to yet."""
        if self._node is None:
            return
        for name in set(simulations) - self._heard:
            self._heard.add(name)
            hear = partial(self._hear, name)
            self._node.create_subscription(UInt8MultiArray, make_shown_topic(name), hear, SHOWN_QOS, raw=True)


def _replace(queue: asyncio.Queue[bytes], frame: bytes) -> None:
    """Put a frame into a queue that holds one frame, in place of the frame that it holds."""
    while not queue.empty():
        queue.get_nowait()
    queue.put_nowait(frame)
