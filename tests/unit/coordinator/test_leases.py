import pytest
from hypothesis import given
from hypothesis import strategies as st

from throwcollect.coordinator.leases import Leases


def test_trials_go_out_by_number_one_to_each_simulation() -> None:
    leases = Leases([2, 0, 1], retries=0)
    assert [leases.lease("a"), leases.lease("b")] == [0, 1]
    with pytest.raises(ValueError, match="a still holds trial 0"):
        leases.lease("a")
    assert leases.complete("a", 0)
    assert leases.lease("a") == 2
    assert leases.lease("c") is None


def test_a_lost_trial_goes_out_again_before_new_ones() -> None:
    leases = Leases(range(4), retries=1)
    leases.lease("a")
    leases.lease("b")
    assert leases.fail("a", "killed") is None
    assert leases.lease("c") == 0


def test_a_trial_is_given_up_with_all_its_evidence() -> None:
    leases = Leases([7], retries=1)
    leases.lease("a")
    assert leases.fail("a", "exit 137") is None
    leases.lease("b")
    assert leases.fail("b", "timeout") == (7, ["a: exit 137", "b: timeout"])
    assert leases.finished


def test_an_episode_that_comes_after_the_lease_was_taken_back_is_refused() -> None:
    leases = Leases([0], retries=3)
    leases.lease("a")
    leases.fail("a", "timeout")
    leases.lease("b")
    assert not leases.complete("a", 0)
    assert leases.complete("b", 0)
    assert leases.ended == 1


@given(st.lists(st.tuples(st.sampled_from("abcd"), st.sampled_from(["lease", "complete", "fail"]))), st.integers(0, 3))
def test_every_trial_ends_exactly_once(actions: list[tuple[str, str]], retries: int) -> None:
    leases = Leases(range(6), retries=retries)
    ended: list[int] = []

    def act(simulation: str, action: str) -> None:
        held = leases.held_by(simulation)
        if action == "lease" and held is None:
            leases.lease(simulation)
        elif action == "complete" and held is not None:
            assert leases.complete(simulation, held)
            ended.append(held)
        elif action == "fail" and (given_up := leases.fail(simulation, "x")):
            ended.append(given_up[0])

    for simulation, action in actions:
        act(simulation, action)
    while not leases.finished:
        act("z", "lease")
        act("z", "complete")
        for simulation in "abcd":
            act(simulation, "complete")
    assert sorted(ended) == list(range(6))


def test_upcoming_trials_are_those_that_are_handed_out_next() -> None:
    leases = Leases(range(5), retries=1)
    leases.lease("a")
    leases.lease("b")
    leases.fail("a", "killed")
    assert leases.upcoming(3) == [0, 2, 3]
    assert [leases.lease("a"), leases.lease("c")] == [0, 2]


def test_trials_may_be_added_while_others_run() -> None:
    leases = Leases([0, 1], retries=1)
    assert [leases.lease("a"), leases.lease("b"), leases.lease("c")] == [0, 1, None]
    leases.complete("a", 0)
    leases.complete("b", 1)
    assert leases.finished
    leases.add([4, 2])
    assert not leases.finished
    assert leases.total == 4
    assert [leases.lease("a"), leases.lease("b"), leases.lease("c")] == [2, 4, None]
