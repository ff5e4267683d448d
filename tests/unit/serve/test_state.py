"""Clients that follow the state of the server get it, and each change of it."""

import asyncio
from collections.abc import AsyncIterator, Awaitable, Callable
from contextlib import aclosing

import pytest

from throwcollect.serve import state as state_module
from throwcollect.serve.catalogue import Catalogue
from throwcollect.serve.state import ComponentState, States, WholeState


class World(States):
    """A stand-in for instances and records, which counts how often they are read."""

    def __init__(self) -> None:
        super().__init__(Catalogue({}))
        self.instances = 0
        self.looks = 0

    def _look(self) -> WholeState:
        self.looks += 1
        return WholeState([ComponentState("a", "A", "session", 1, [str(self.instances)])], [])


@pytest.fixture(autouse=True)
def _quickly(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(state_module, "_LOOK_S", 0.005)
    monkeypatch.setattr(state_module, "_FRESH_S", 0.05)


def run(scenario: Callable[[World], Awaitable[None]]) -> None:
    async def whole() -> None:
        await asyncio.wait_for(scenario(World()), 10)

    asyncio.run(whole())


async def read(states: AsyncIterator[WholeState]) -> tuple[int, str]:
    found = await anext(states)
    return found.revision, found.components[0].instances[0]


def test_a_slow_client_gets_only_the_latest_state() -> None:
    async def scenario(world: World) -> None:
        async with aclosing(world.follow()) as slow, aclosing(world.follow()) as quick:
            assert await read(slow) == await read(quick) == (1, "0")
            for number in range(1, 6):
                world.instances = number
                assert await read(quick) == (number + 1, str(number))
            assert await read(slow) == (6, "5")

    run(scenario)


def test_thirty_clients_share_the_looks_at_the_records() -> None:
    async def scenario(world: World) -> None:
        clients = [world.follow() for _ in range(30)]
        for each in clients:
            await anext(each)
        assert world.looks < 10
        world.instances = 7
        assert {await read(each) for each in clients} == {(2, "7")}
        assert world.looks < 10
        # Who asks for the state itself gets one that is read then.
        before = world.looks
        await world.read()
        assert world.looks == before + 1

    run(scenario)
