"""The order in which a simulation does leased trials, while a coordinator changes the leases."""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import pytest

from throwcollect.episode.episode_message import TrialRefusal
from throwcollect.errors import ThrowcollectError
from throwcollect.plan.lease import Lease
from throwcollect.ros.nodes.simulation.leases import LeaseQueue
from throwcollect.run_key import Signer

A, B, C = (Lease.make("/sim_0", trial, {}, Signer(b"")) for trial in range(3))
BAD = Lease.make("/sim_0", 99, {}, Signer(b""))


class Runner:
    """Stands in for a simulator: its trials end when a test wants that."""

    def __init__(self) -> None:
        self.begun: list[int] = []
        self.dropped = 0
        self.yields: Any = None

    def begin(self, trial: int, _values: Mapping[str, float], **_further: object) -> None:
        if trial == BAD.trial:
            raise ThrowcollectError("out of reach")
        self.begun.append(trial)

    def drop(self) -> None:
        self.dropped += 1

    def hand_over(self) -> Any:
        yields, self.yields = self.yields, None
        if isinstance(yields, ThrowcollectError):
            raise yields
        return yields


def queue_of(*leases: Lease) -> tuple[LeaseQueue, Runner]:
    runner = Runner()
    queue = LeaseQueue(runner)  # type: ignore[arg-type]
    queue.replace(leases)
    return queue, runner


def end_trial(queue: LeaseQueue, runner: Runner) -> None:
    runner.yields = "an episode"
    assert queue.collect() == ["an episode"]


def test_leased_trials_are_done_in_order() -> None:
    queue, runner = queue_of(A, B, C)
    assert runner.begun == [0]
    end_trial(queue, runner)
    end_trial(queue, runner)
    assert runner.begun == [0, 1, 2]
    end_trial(queue, runner)
    assert runner.begun == [0, 1, 2]
    assert queue.collect() == []


def test_the_running_trial_goes_on_if_it_is_leased_again() -> None:
    queue, runner = queue_of(A, B)
    queue.replace([A, C])
    assert (runner.begun, runner.dropped) == ([0], 0)
    end_trial(queue, runner)
    assert runner.begun == [0, 2]


def test_the_running_trial_goes_on_under_a_new_lease_and_is_done_once() -> None:
    queue, runner = queue_of(A, B)
    again = [replace(lease, nonce="new") for lease in (A, B)]
    queue.replace(again)
    end_trial(queue, runner)
    queue.replace(again)
    assert (runner.begun, runner.dropped) == ([0, 1], 0)


def test_a_trial_that_is_done_is_done_again_only_under_a_new_lease() -> None:
    queue, runner = queue_of(A)
    end_trial(queue, runner)
    queue.replace([replace(A, nonce="new")])
    assert runner.begun == [0, 0]


def test_the_running_trial_is_dropped_if_it_is_leased_with_other_values() -> None:
    queue, runner = queue_of(A)
    queue.replace([replace(A, values={"ball.mass_kg": 0.05})])
    assert (runner.begun, runner.dropped) == ([0, 0], 1)


def test_the_running_trial_is_dropped_if_its_lease_is_gone() -> None:
    queue, runner = queue_of(A, B)
    queue.replace([C])
    assert (runner.begun, runner.dropped) == ([0, 2], 1)
    queue.replace([])
    assert (runner.begun, runner.dropped) == ([0, 2], 2)


def test_a_late_list_of_leases_does_not_repeat_an_ended_trial() -> None:
    queue, runner = queue_of(A)
    end_trial(queue, runner)
    queue.replace([A, B])
    assert runner.begun == [0, 1]


def test_a_trial_that_cannot_begin_is_refused_and_the_next_one_begins() -> None:
    runner = Runner()
    queue = LeaseQueue(runner)  # type: ignore[arg-type]
    queue.replace([BAD, A])
    assert queue.collect() == [TrialRefusal(BAD.trial, "out of reach")]
    assert (runner.begun, runner.dropped) == ([0], 1)


def test_a_trial_whose_episode_is_unusable_is_refused() -> None:
    queue, runner = queue_of(A, B)
    runner.yields = ThrowcollectError("not finite")
    assert queue.collect() == [TrialRefusal(A.trial, "not finite")]
    assert runner.begun == [0, 1]


def test_a_trial_in_which_the_engine_fails_is_dropped_and_refused() -> None:
    queue, runner = queue_of(A, B)
    queue.fail(ThrowcollectError("broken"))
    assert queue.collect() == [TrialRefusal(A.trial, "broken")]
    assert (runner.begun, runner.dropped) == ([0, 1], 1)
    with pytest.raises(ThrowcollectError, match="broken"):
        queue_of()[0].fail(ThrowcollectError("broken"))
