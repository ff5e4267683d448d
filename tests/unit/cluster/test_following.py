"""What is told of a dataset on a cluster while it is followed."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

from throwcollect.cluster.following import Look, ProgressOfSlices

TASK = SimpleNamespace(success="landed", noun="throw")
RUN: Any = SimpleNamespace(
    trials=30, simulations_per_task=1, submission=SimpleNamespace(live=False), config=SimpleNamespace(task=TASK)
)


def test_the_speed_is_that_of_the_trials_which_ended_while_one_looked() -> None:
    seconds = iter([100.0, 110.0])
    progress = ProgressOfSlices(RUN, clock=lambda: next(seconds))
    looks = [Look(frozenset(), (), None, complete) for complete in (False, True)]
    assert [progress.at(look).throws_per_s for look in looks] == [0.0, 3.0]
