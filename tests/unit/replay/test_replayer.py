"""The world of a replayer is freed with it: a process can have a few physics engines at a time."""

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


def test_a_world_is_freed_once(closed: list[World]) -> None:
    replayer = Replayer(Config.model_validate({"sim": {"engine": "ballistic"}}))
    replayer.close()
    assert len(closed) == 1
    del replayer
    assert len(closed) == 1


def test_throws_that_this_process_simulates_leave_no_world(dataset: Path, closed: list[World]) -> None:
    (comparison,) = replay_throws(dataset, [4])
    assert comparison.trial == 4
    assert len(closed) == 1
