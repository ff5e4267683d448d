import pytest
from hypothesis import given
from hypothesis import strategies as st

from throwcollect.coordinator.leases import Leases


def test_trials_go_out_by_number_one_to_each_simulation() -> None:
    leases = Leases([2, 0, 1], retries=0)
    assert [leases.lease("a"), leases.lease("b")] == [0, 1]
    with pytest.raises(ValueError, match="a still holds trial 0"):
        leases.lease("a")
    assert leases.deliver("a", 0)
    leases.complete(0)
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
    assert not leases.deliver("a", 0)
    assert leases.deliver("b", 0)
    assert leases.ended == 0
    assert leases.leased == 1
    leases.complete(0)
    assert leases.ended == 1


ACTIONS = st.tuples(st.sampled_from("abcd"), st.sampled_from(["lease", "complete", "reject", "fail", "refuse"]))


@given(st.lists(ACTIONS), st.integers(0, 3), st.booleans())
def test_every_trial_ends_exactly_once(actions: list[tuple[str, str]], retries: int, present: bool) -> None:
    leases = Leases(range(6), retries=retries)
    ended: list[int] = []

    def act(simulation: str, action: str) -> None:
        held = leases.find_trial(simulation)
        if action == "lease" and held is None:
            leases.lease(simulation, others="abcdz" if present else "")
        elif action == "complete" and held is not None:
            assert leases.deliver(simulation, held)
            leases.complete(held)
            ended.append(held)
        elif action == "reject" and held is not None:
            assert leases.deliver(simulation, held)
            if leases.reject(held, "x"):
                ended.append(held)
        elif action in ("fail", "refuse") and (given_up := leases.fail(simulation, "x", refused=action == "refuse")):
            ended.append(given_up[0])

    for simulation, action in actions:
        act(simulation, action)
    present = False
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
    for simulation, trial in (("a", 0), ("b", 1)):
        leases.deliver(simulation, trial)
        leases.complete(trial)
    assert leases.finished
    leases.add([4, 2])
    assert not leases.finished
    assert leases.total == 4
    assert [leases.lease("a"), leases.lease("b"), leases.lease("c")] == [2, 4, None]


BOTH = ("hole", "well")


def do_all(leases: Leases) -> list[int]:
    """Let one simulation refuse whatever it gets, and the other one do everything; trials that were given up."""
    given_up = []
    while not leases.finished:
        if leases.lease("hole", others=BOTH) is not None and (lost := leases.fail("hole", "no", refused=True)):
            given_up.append(lost[0])
        if (trial := leases.lease("well", others=BOTH)) is not None:
            leases.deliver("well", trial)
            leases.complete(trial)
    return given_up


def test_a_simulation_that_refuses_everything_takes_no_trial_with_it() -> None:
    leases = Leases(range(60), retries=3)
    assert do_all(leases) == []
    assert leases.why_set_aside("hole") == "no"
    assert leases.why_set_aside("well") is None


def test_a_simulation_that_spoils_episodes_is_set_aside_too() -> None:
    leases = Leases(range(60), retries=3)
    for _ in range(3):
        trial = leases.lease("hole", others=BOTH)
        leases.deliver("hole", trial)
        assert leases.reject(trial, "not finite") is None
    assert do_all(leases) == []
    assert leases.why_set_aside("hole") == "not finite"


def test_a_returned_trial_goes_to_another_simulation_while_there_is_one() -> None:
    leases = Leases(range(2), retries=3)
    leases.lease("a", others="ab")
    leases.fail("a", "refused", refused=True)
    assert leases.lease("a", others="ab") == 1
    assert leases.lease("b", others="ab") == 0


def test_a_simulation_alone_gets_its_trial_back() -> None:
    leases = Leases([0], retries=3)
    leases.lease("a", others="a")
    leases.fail("a", "killed")
    assert leases.lease("a", others="a") == 0


def test_trials_that_nobody_can_do_cost_no_simulation_its_place() -> None:
    leases = Leases(range(30), retries=3)
    lost = []
    while not leases.finished:
        for name in ("a", "b"):
            trial = leases.lease(name, others="ab")
            if trial is None:
                continue
            if trial < 20 and trial:
                if given_up := leases.fail(name, "it cannot be done", refused=True):
                    lost.append(given_up[0])
            else:
                leases.deliver(name, trial)
                leases.complete(trial)
    assert sorted(lost) == list(range(1, 20))
    assert leases.why_set_aside("a") is None
    assert leases.why_set_aside("b") is None


def test_there_is_no_hope_when_all_refuse_and_none_ever_did_a_trial() -> None:
    leases = Leases(range(30), retries=3)
    for _ in range(3):
        assert leases.hopeless("ab") is None
        for name in "ab":
            leases.lease(name, others="ab")
        for name in "ab":
            leases.fail(name, "other sources", refused=True)
    assert leases.hopeless("ab") == "other sources"
    assert leases.hopeless("abc") is None


def test_one_completed_trial_gives_hope_for_good() -> None:
    leases = Leases(range(30), retries=3)
    leases.deliver("a", leases.lease("a"))
    leases.complete(0)
    for _ in range(9):
        leases.lease("a", others="a")
        leases.fail("a", "no", refused=True)
    assert leases.hopeless("a") is None


def test_a_new_simulation_of_an_old_name_is_not_blamed() -> None:
    leases = Leases(range(60), retries=3)
    do_all(leases)
    leases.add([60])
    leases.forget("hole")
    assert leases.why_set_aside("hole") is None
    assert leases.lease("hole", others=BOTH) == 60
