"""Watchers get the state of the server and each change of it."""

import asyncio
import json
from collections.abc import Awaitable, Callable
from contextlib import aclosing
from typing import Any

import pytest

from throwcollect.errors import ConfigError
from throwcollect.serve import watching
from throwcollect.serve.state import ComponentState, WholeState
from throwcollect.serve.watching import StateWatch


class World:
    """A stand-in for instances and records, which counts how often they are read."""

    def __init__(self) -> None:
        self.instances = 0
        self.looks = 0
        self.error: Exception | None = None

    def look(self) -> WholeState:
        self.looks += 1
        if self.error is not None:
            raise self.error
        return WholeState([ComponentState("a", "A", "session", 1, [str(self.instances)])], [])


@pytest.fixture(autouse=True)
def _quickly(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(watching, "_LOOK_S", 0.005)


def run(scenario: Callable[[World, StateWatch], Awaitable[None]]) -> None:
    async def whole() -> None:
        world = World()
        await asyncio.wait_for(scenario(world, StateWatch(world.look)), 10)

    asyncio.run(whole())


async def read(states: Any) -> tuple[int, str]:
    found = json.loads(await anext(states))
    return found["revision"], found["components"][0]["instances"][0]


def test_a_watcher_gets_the_state_and_then_each_change() -> None:
    async def scenario(world: World, watch: StateWatch) -> None:
        async with aclosing(watch.states()) as states:
            assert await read(states) == (1, "0")
            world.instances = 1
            assert await read(states) == (2, "1")

    run(scenario)


def test_a_slow_watcher_gets_only_the_latest_state() -> None:
    async def scenario(world: World, watch: StateWatch) -> None:
        async with aclosing(watch.states()) as slow, aclosing(watch.states()) as quick:
            await anext(slow)
            await anext(quick)
            for number in range(1, 6):
                world.instances = number
                assert await read(quick) == (number + 1, str(number))
            assert await read(slow) == (6, "5")

    run(scenario)


def test_thirty_watchers_share_one_loop_that_reads_the_records() -> None:
    async def scenario(world: World, watch: StateWatch) -> None:
        listeners = [watch.states() for _ in range(30)]
        for each in listeners:
            await anext(each)
        before, began = world.looks, asyncio.get_running_loop().time()
        await asyncio.sleep(0.1)
        assert world.looks - before <= (asyncio.get_running_loop().time() - began) / 0.005 + 1
        world.instances = 7
        assert {await read(each) for each in listeners} == {(2, "7")}
        for each in listeners:
            await each.aclose()
        await asyncio.sleep(0.02)
        before = world.looks
        await asyncio.sleep(0.05)
        assert world.looks == before

    run(scenario)


@pytest.mark.parametrize("error", [ConfigError("the disk is full"), OSError("it is gone"), TypeError("a mistake")])
def test_watching_goes_on_after_an_error_which_is_logged_once_if_it_is_unexpected(
    error: Exception, caplog: pytest.LogCaptureFixture
) -> None:
    async def scenario(world: World, watch: StateWatch) -> None:
        async with aclosing(watch.states()) as states:
            await anext(states)
            world.error = error
            before = world.looks
            while world.looks < before + 3:
                await asyncio.sleep(0.005)
            world.error, world.instances = None, 1
            assert await read(states) == (2, "1")

    run(scenario)
    logged = [each.exc_info[1] for each in caplog.records if each.name == watching.__name__ and each.exc_info]
    assert logged == ([error] if isinstance(error, TypeError) else [])
