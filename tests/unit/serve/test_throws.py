"""The newest throws, as they are sent to the page, and how they are heard."""

from __future__ import annotations

import asyncio
import json
from collections.abc import AsyncGenerator, Awaitable, Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from tests.unit.dataset.conftest import Collection
from tests.unit.serve.conftest import Remember

from throwcollect.collect.runs.run import Run
from throwcollect.collect.runtimes.run_record import NodeState
from throwcollect.config.schema import Config
from throwcollect.dataset.reader import Dataset
from throwcollect.episode.channels import Channels
from throwcollect.episode.episode_message import Episode
from throwcollect.episode.message_table import ChunkEncoder
from throwcollect.robots.description import full_description
from throwcollect.robots.surroundings import looks_of
from throwcollect.serve import throws
from throwcollect.serve.rosbridge.bridge import Listener, Sample
from throwcollect.serve.throws import describe_trial, encode_throw, hear_throws


class Graph:
    """Takes the place of a bridge: ``hear`` has the listeners by their topics, and ``look`` lets its timers run out."""

    def __init__(self) -> None:
        self.hear: dict[str, list[Listener]] = {}
        self._timers: list[Callable[[], None]] = []

    def submit(self, action: Callable[[], None]) -> None:
        action()

    def later(self, _seconds: float, action: Callable[[], None]) -> None:
        self._timers.append(action)

    def listen(self, topic: str, _type: str, listener: Listener) -> Callable[[], object]:
        self.hear.setdefault(topic, []).append(listener)
        return lambda: self.hear[topic].remove(listener)

    def publish(self, topic: str, data: bytes) -> None:
        for listener in self.hear[topic]:
            listener(Sample(data, None, 0))

    def look(self) -> None:
        timers, self._timers = self._timers, []
        for each in timers:
            each()


def watch(run: Run, scenario: Callable[[Graph, list[AsyncGenerator[bytes]]], Awaitable[None]]) -> None:
    """Let two watchers wait for throws of a run that a stand-in publishes."""

    async def whole() -> None:
        graph: Any = Graph()
        await asyncio.wait_for(scenario(graph, [hear_throws(run, graph) for _ in range(2)]), 10)

    asyncio.run(whole())


POST = {"shape": "sphere", "radius_m": 0.1, "position_m": [1, 2, 3]}


def test_an_encoded_throw_holds_its_result_values_and_samples(collected: Path) -> None:
    episode = next(iter(Dataset.open(collected).episodes()))
    samples = episode.samples()
    result = {"outcome": "landed", "landing_x_m": 1.0, "landing_y_m": -0.5, "landing_z_m": 0.02}
    judged = Episode(episode.header, episode.chunk, result=json.dumps(result))
    looks = looks_of(Config.model_validate({"scene": {"bodies": {"post": POST}}}))
    frame = encode_throw(judged, "sim_0", {"ball.mass_kg": 0.05}, looks)
    size = int.from_bytes(frame[:4], "little")
    header = json.loads(frame[4 : 4 + size])
    assert header["landing"] == [1.0, -0.5, 0.02]
    assert header["values"] == {"ball.mass_kg": 0.05}
    assert [(each["name"], each["size_m"]) for each in header["bodies"]] == [("post", [0.2] * 3), ("ball", [0.05] * 3)]
    assert (header["trial"], header["outcome"], header["samples"]) == (0, "landed", len(samples))
    assert header["rate_hz"] == pytest.approx(1e9 / (samples.stamps_ns[1] - samples.stamps_ns[0]))
    begin = 4 + size + (-(4 + size) % 4)
    assert not any(frame[4 + size : begin])
    numbers = np.frombuffer(frame[begin:], "<f4")
    joints = len(samples) * len(header["joints"])
    assert np.allclose(numbers[:joints].reshape(len(samples), -1), samples.position)
    path, poses = np.split(numbers[joints:], [3 * len(samples)])
    assert np.allclose(path.reshape(-1, 3), samples.object_position)
    assert np.allclose(poses.reshape(-1, 7)[:, 3:], samples.object_orientation_xyzw)
    fell = json.dumps({**result, "landing_z_m": None})
    told = encode_throw(Episode(episode.header, episode.chunk, result=fell), "sim_0", {}, ())
    header = json.loads(told[4 : 4 + int.from_bytes(told[:4], "little")])
    assert (header["landing"], header["bodies"]) == (None, [])


def test_an_encoded_throw_holds_the_poses_of_bodies_that_move(collected: Path) -> None:
    episode = next(iter(Dataset.open(collected).episodes()))
    config = Config.model_validate({"scene": {"bodies": {"can": {**POST, "mass_kg": 0.1}, "post": POST}}})
    bodies = np.random.default_rng(1).normal(size=(len(episode.samples()), 1, 13))
    bodies[:, :, 3:7] /= np.linalg.norm(bodies[:, :, 3:7], axis=2, keepdims=True)
    channels = Channels(config, full_description(config))
    chunk, _ = ChunkEncoder(channels, level=1).encode(replace(episode.samples(), bodies=bodies))
    frame = encode_throw(Episode(episode.header, chunk, result='{"outcome": "landed"}'), "sim_0", {}, looks_of(config))
    header = json.loads(frame[4 : 4 + int.from_bytes(frame[:4], "little")])
    moves = {each["name"]: each["moves"] for each in header["bodies"]}
    assert moves == {"can": True, "post": False, "ball": True}
    poses = np.frombuffer(frame[-len(bodies) * 14 * 4 :], "<f4").reshape(-1, 14)
    np.testing.assert_allclose(poses[:, :7], bodies[:, 0, :7], rtol=1e-6)
    np.testing.assert_allclose(poses[:, 7:10], episode.samples().object_position, rtol=1e-6)


def test_a_throw_has_the_values_and_the_bodies_of_its_own_trial(tmp_path: Path) -> None:
    swept = {"task.bin.x_m": {"values": [1.0, 2.0]}}
    settings = {"trials": None, "task": {"name": "throw_into"}, "sweep": {"sampler": "grid", "parameters": swept}}
    directory = Collection(settings).collect(tmp_path / "a")
    found = [describe_trial(Dataset.open(directory).plan, number) for number in (0, 1)]
    assert [values for values, _ in found] == [{"task.bin.x_m": 1.0}, {"task.bin.x_m": 2.0}]
    assert [bodies[0].position_m[0] for _, bodies in found] == [1.0, 2.0]


def make_nodes(*names: str) -> tuple[NodeState, ...]:
    return tuple(NodeState(name, "running", 0, "1", "") for name in names)


def test_watchers_hear_all_simulations_until_they_leave(remember: Remember, monkeypatch: pytest.MonkeyPatch) -> None:
    run = remember("a", nodes=make_nodes("router", "sim_0"))
    monkeypatch.setattr(throws, "_encode", lambda _run, simulation, message: simulation.encode() + message)

    async def scenario(graph: Graph, watchers: list[AsyncGenerator[bytes]]) -> None:
        heard = [asyncio.ensure_future(anext(each)) for each in watchers]
        await asyncio.sleep(0)
        assert {name: len(each) for name, each in graph.hear.items()} == {"/coordinator/shown/sim_0": 2}
        run.update(nodes=make_nodes("sim_0", "sim_1"))
        graph.look()
        assert {name: len(each) for name, each in graph.hear.items()} == {
            "/coordinator/shown/sim_0": 2,
            "/coordinator/shown/sim_1": 2,
        }
        graph.publish("/coordinator/shown/sim_1", b"1")
        assert [await each for each in heard] == [b"sim_11"] * 2
        # A slow watcher gets only the newest throw.
        for data in (b"2", b"3", b"4"):
            graph.publish("/coordinator/shown/sim_0", data)
        await asyncio.sleep(0)
        assert await anext(watchers[0]) == b"sim_04"
        for each in watchers:
            await each.aclose()
        graph.look()
        assert not any(graph.hear.values())

    watch(run, scenario)


def test_messages_that_are_no_signed_episodes_are_ignored(remember: Remember) -> None:
    run = remember("a")
    for message in (b"", b"nonsense", bytes(10_000)):
        assert throws._encode(run, "sim_0", message) is None
