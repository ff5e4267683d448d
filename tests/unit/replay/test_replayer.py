"""The world of a replayer is closed with it, because a process can have only a few physics engines at a time."""

from __future__ import annotations

from pathlib import Path

import pytest

from throwcollect.config.schema import Config
from throwcollect.replay.audit import replay_throws
from throwcollect.replay.replayer import Replayer
from throwcollect.sim.world import World


@pytest.fixture
def closed(monkeypatch: pytest.MonkeyPatch) -> list[World]:
    """The worlds that have been closed."""
    worlds: list[World] = []
    monkeypatch.setattr(World, "close", lambda world: worlds.append(world))  # noqa: PLW0108 - this one is bound
    return worlds


def test_closing_or_deleting_a_replayer_closes_its_world_once(closed: list[World]) -> None:
    for close_first in (True, False):
        replayer = Replayer(Config.model_validate({"sim": {"engine": "ballistic"}}))
        if close_first:
            replayer.close()
            assert len(closed) == 1
        del replayer
        assert len(closed) == (1 if close_first else 2)


def test_replaying_throws_closes_the_world_afterwards(dataset: Path, closed: list[World]) -> None:
    (comparison,) = replay_throws(dataset, [4])
    assert comparison.trial == 4
    assert len(closed) == 1
