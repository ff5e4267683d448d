"""The end of a dataset depends on the outcomes of its trials, and not on the order in which they arrive."""

from random import Random

import pytest

from throwcollect.collect.coordinator.leases import Prefix


def find_end(outcomes: list[bool], wanted: int) -> int:
    """How many trials one has to do, one after the other, until enough have succeeded."""
    for count in range(len(outcomes) + 1):
        if sum(outcomes[:count]) == wanted:
            return count
    return len(outcomes)


@pytest.mark.parametrize("seed", range(50))
def test_the_end_is_that_of_doing_one_trial_after_the_other(seed: int) -> None:
    random = Random(seed)
    first = random.choice([0, 40])
    outcomes = [random.random() < 0.6 for _ in range(random.randrange(1, 60))]
    wanted = random.randrange(1, 30)
    refused = [number for number, outcome in enumerate(outcomes) if not outcome and random.random() < 0.3]
    numbers = range(first, first + len(outcomes))
    prefix = Prefix(numbers, wanted=wanted, refused=[first + number for number in refused])
    end = first + find_end(outcomes, wanted)
    ended = set(refused)
    while not prefix.complete:
        assert prefix.stop <= end
        started = [number for number in range(prefix.stop - first) if number not in ended]
        trial = random.choice(started)
        ended.add(trial)
        prefix.end(first + trial, succeeded=outcomes[trial])
    assert prefix.stop == end


def test_without_a_wanted_number_all_trials_belong_to_the_dataset() -> None:
    prefix = Prefix(range(3), wanted=None, refused=[1])
    assert prefix.stop == 3
    for trial in (0, 0, 2):
        assert not prefix.complete
        prefix.end(trial, succeeded=False)
    assert prefix.complete
