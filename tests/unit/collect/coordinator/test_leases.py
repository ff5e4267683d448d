from hypothesis import given
from hypothesis import strategies as st

from throwcollect.collect.coordinator.leases import Leases


def test_trials_are_leased_in_order_of_their_numbers() -> None:
    leases = Leases([2, 0, 1], retries=0)
    assert [leases.lease("a"), leases.lease("b"), leases.lease("a")] == [0, 1, 2]
    assert leases.find_held("a") == (0, 2)
    assert leases.waiting == 0
    leases.complete("a", 0)
    assert leases.find_held("a") == (2,)
    assert leases.lease("c") is None
    assert leases.leased == 2


def test_a_failed_trial_is_leased_again_before_new_ones() -> None:
    leases = Leases(range(4), retries=1)
    leases.lease("a")
    leases.lease("b")
    assert leases.fail("a", 0, "killed") is None
    assert leases.lease("c") == 0


def test_a_trial_that_is_given_up_lists_all_its_failures() -> None:
    leases = Leases([7], retries=1)
    leases.lease("a")
    assert leases.fail("a", 7, "exit 137") is None
    leases.lease("b")
    assert leases.fail("b", 7, "timeout") == ["a: exit 137", "b: timeout"]
    assert leases.ended == leases.total


def test_only_trials_of_the_plan_that_have_not_ended_are_open() -> None:
    leases = Leases([1, 3], retries=0)
    leases.recall(3)
    assert [trial for trial in range(-2, 6) if leases.is_open(trial)] == [1]
    leases.fail("a", leases.lease("a") or 0, "killed")
    assert not leases.is_open(1)


def test_failures_of_simulations_that_are_alive_never_give_a_trial_up() -> None:
    leases = Leases([0], retries=1)
    for _ in range(20):
        leases.lease("a")
        assert leases.fail("a", 0, "slow", alive=True) is None
        leases.lease("a")
        assert leases.fail("a", 0, "out of sight", alive=None) is None
        assert leases.settle("a", alive=True) is None
    for given_up in (None, ["a: killed", "a: killed"]):
        leases.lease("a")
        assert leases.fail("a", 0, "killed") == given_up


def test_a_trial_without_retries_left_waits_until_it_is_known_whether_its_simulation_lives() -> None:
    leases = Leases([0], retries=0)
    for fate in (True, False):
        assert leases.lease("a") == 0
        assert leases.fail("a", 0, "out of sight", alive=None) is None
        assert leases.lease("b") is None
        assert leases.ended < leases.total
        assert leases.settle("a", alive=fate) == (None if fate else (0, ["a: out of sight"]))
    assert leases.ended == leases.total
    assert leases.settle("a", alive=False) is None


def test_a_simulation_that_comes_back_is_excused_only_for_its_last_failure() -> None:
    leases = Leases([0], retries=1)
    leases.lease("a")
    leases.fail("a", 0, "killed")
    leases.lease("a")
    leases.fail("a", 0, "out of sight", alive=None)
    leases.settle("a", alive=True)
    leases.lease("a")
    assert leases.fail("a", 0, "killed") == ["a: killed", "a: killed"]


ACTIONS = st.tuples(
    st.sampled_from("abcd"),
    st.sampled_from(["lease", "complete", "come late", "release", "fail", "refuse", "leave", "return", "restart"]),
)


@given(st.lists(ACTIONS), st.integers(0, 3), st.booleans())
def test_every_trial_ends_exactly_once(actions: list[tuple[str, str]], retries: int, present: bool) -> None:
    leases = Leases(range(6), retries=retries)
    ended: list[int] = []

    def act(simulation: str, action: str) -> None:
        held = leases.find_held(simulation)
        if action == "lease":
            leases.lease(simulation, others="abcdz" if present else "")
        elif action == "come late" and leases.is_open(0):
            leases.complete(simulation, 0)
            ended.append(0)
        elif action == "leave":
            leases.release(simulation)
            for trial in held[:1]:
                assert leases.fail(simulation, trial, "x", alive=None) is None
        elif action in ("return", "restart"):
            if (given_up := leases.settle(simulation, alive=action == "return")) is not None:
                ended.append(given_up[0])
        elif action == "release":
            leases.release(simulation)
        elif action == "complete" and held:
            leases.complete(simulation, held[-1])
            ended.append(held[-1])
        elif (
            action in ("fail", "refuse") and held and leases.fail(simulation, held[0], "x", refused=action == "refuse")
        ):
            ended.append(held[0])
        assert len(ended) == leases.ended
        assert leases.ended + leases.leased + leases.waiting == leases.total

    for simulation, action in actions:
        act(simulation, action)
    present = False
    while leases.ended < leases.total:
        act("z", "lease")
        act("z", "complete")
        for simulation in "abcd":
            act(simulation, "complete")
            act(simulation, "restart")
    assert sorted(ended) == list(range(6))


BOTH = ("hole", "well")


def do_all(leases: Leases) -> list[int]:
    """One simulation refuses every trial, the other completes every trial; returns the trials that were given up."""
    given_up = []
    while leases.ended < leases.total:
        trial = leases.lease("hole", others=BOTH)
        if trial is not None and leases.fail("hole", trial, "no", refused=True):
            given_up.append(trial)
        if (trial := leases.lease("well", others=BOTH)) is not None:
            leases.complete("well", trial)
    return given_up


def test_a_simulation_that_refuses_every_trial_gets_no_more_and_loses_none() -> None:
    leases = Leases(range(60), retries=3)
    assert do_all(leases) == []
    leases.add([60])
    # Even alone, it cannot spoil trials.
    assert leases.lease("hole", others=["hole"]) is None
    leases.forget("hole")
    assert leases.lease("hole", others=BOTH) == 60


def test_a_returned_trial_goes_to_another_simulation_while_there_is_one() -> None:
    leases = Leases(range(2), retries=3)
    leases.lease("a", others="ab")
    leases.fail("a", 0, "refused", refused=True)
    assert leases.lease("a", others="ab") == 1
    assert leases.lease("b", others="ab") == 0


def test_a_simulation_that_is_alone_gets_its_failed_trial_back() -> None:
    leases = Leases([0], retries=3)
    leases.lease("a", others="a")
    leases.fail("a", 0, "killed")
    assert leases.lease("a", others="a") == 0


def test_trials_that_every_simulation_refuses_keep_no_simulation_from_others() -> None:
    leases = Leases(range(30), retries=3)
    lost = []
    while leases.ended < leases.total:
        for name in ("a", "b"):
            trial = leases.lease(name, others="ab")
            if trial is None:
                continue
            if trial < 20 and trial:
                if leases.fail(name, trial, "it cannot be done", refused=True):
                    lost.append(trial)
            else:
                leases.complete(name, trial)
    assert sorted(lost) == list(range(1, 20))
    leases.add([30])
    assert leases.lease("a", others="a") == 30


def test_a_collection_is_hopeless_once_every_simulation_only_refuses_trials() -> None:
    leases = Leases(range(30), retries=3)
    for _ in range(3):
        assert leases.explain_hopelessness("ab") is None
        trials = {name: leases.lease(name, others="ab") for name in "ab"}
        for name, trial in trials.items():
            leases.fail(name, trial, "other sources", refused=True)
    assert leases.explain_hopelessness("ab") == "other sources"
    assert leases.explain_hopelessness("abc") is None


def test_a_collection_with_a_completed_trial_is_never_hopeless() -> None:
    leases = Leases(range(30), retries=3)
    leases.complete("a", leases.lease("a"))
    for _ in range(9):
        leases.fail("a", leases.lease("a", others="a"), "no", refused=True)
    assert leases.explain_hopelessness("a") is None
