"""How many trials a simulation gets at once."""

import pytest

from throwcollect.collect.coordinator import prefetch
from throwcollect.collect.coordinator.prefetch import Prefetch


class Clock:
    def __init__(self) -> None:
        self.now = 100.0

    def monotonic(self) -> float:
        return self.now


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> Clock:
    clock = Clock()
    monkeypatch.setattr(prefetch, "time", clock)
    return clock


def after_one_of(seconds: float, clock: Clock) -> Prefetch:
    ahead = Prefetch()
    ahead.begin("a")
    clock.now += seconds
    ahead.end("a")
    return ahead


def test_a_new_simulation_gets_one_trial() -> None:
    assert Prefetch().count_for("a", waiting=1000, simulations=2) == 1


@pytest.mark.parametrize(("seconds", "count"), [(0.0, 16), (0.01, 16), (0.11, 5), (0.3, 2), (0.5, 1), (20.0, 1)])
def test_a_simulation_gets_as_many_trials_as_last_half_a_second(seconds: float, count: int, clock: Clock) -> None:
    assert after_one_of(seconds, clock).count_for("a", waiting=1000, simulations=2) == count


@pytest.mark.parametrize(("waiting", "count"), [(1000, 16), (40, 10), (4, 1), (1, 1), (0, 1)])
def test_the_last_trials_are_shared_among_the_simulations(waiting: int, count: int, clock: Clock) -> None:
    assert after_one_of(0.01, clock).count_for("a", waiting=waiting, simulations=2) == count


def test_a_simulation_that_has_become_slow_gets_fewer_trials(clock: Clock) -> None:
    ahead = after_one_of(0.01, clock)
    for _ in range(20):
        clock.now += 1.0
        ahead.end("a")
    assert ahead.count_for("a", waiting=1000, simulations=1) == 1


def test_idle_time_of_a_simulation_does_not_count_as_time_of_a_trial(clock: Clock) -> None:
    ahead = after_one_of(0.11, clock)
    clock.now += 60.0
    ahead.begin("a")
    clock.now += 0.11
    ahead.end("a")
    assert ahead.count_for("a", waiting=1000, simulations=1) == 5


def test_the_speed_of_a_simulation_that_left_is_forgotten(clock: Clock) -> None:
    ahead = after_one_of(0.1, clock)
    ahead.forget("a")
    assert ahead.count_for("a", waiting=1000, simulations=1) == 1
