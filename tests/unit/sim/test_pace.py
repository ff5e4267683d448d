"""Stretches of simulated time: time goes on at real time times a factor."""

import pytest

from throwcollect.sim import pace
from throwcollect.sim.pace import Pace, count_steps


class Clock:
    """A clock that goes on only when the code under test sleeps or a test works."""

    def __init__(self) -> None:
        self.now = 1000.0

    def monotonic(self) -> float:
        return self.now

    def sleep(self, seconds: float) -> None:
        self.now += seconds


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> Clock:
    clock = Clock()
    monkeypatch.setattr(pace, "time", clock)
    return clock


@pytest.mark.parametrize(
    ("factor", "hz", "period", "steps"),
    [
        (1.0, 500, 2, 2),  # a sample every 4 ms
        (1.0, 1000, 10, 10),
        (1.0, 10000, 1, 40),  # no stretch is shorter than 4 ms of real time
        (5.0, 500, 2, 10),
        (5.0, 1000, 100, 50),  # nor longer than 50 ms
        (0.1, 500, 2, 2),
        (0.001, 500, 2, 1),
        (1000.0, 500, 2, 25),
    ],
)
def test_the_length_of_a_stretch_follows_from_factor_rate_and_sample_period(
    factor: float, hz: int, period: int, steps: int
) -> None:
    assert count_steps(factor, hz, period, 0) == steps


def test_a_stretch_ends_with_the_sample_period() -> None:
    assert count_steps(1.0, 500, 5, 3) == 2
    assert count_steps(0.001, 500, 5, 3) == 1


def run(pace: Pace, clock: Clock, *, since_ns: int, work_s: float, factor: float = 1.0) -> float:
    """A stretch of 4 ms that takes some work; real time of its end [s]."""
    began_s = clock.now
    clock.now += work_s
    pace.wait(factor, began_s=began_s, since_ns=since_ns, until_ns=since_ns + 4_000_000)
    return clock.now


def test_time_spent_between_stretches_does_not_add_up(clock: Clock) -> None:
    keeper, ends = Pace(), []
    for number in range(100):
        clock.now += 0.001
        ends.append(run(keeper, clock, since_ns=number * 4_000_000, work_s=0.002))
    assert ends[-1] - ends[0] == pytest.approx(99 * 0.004)


def test_a_stretch_that_took_too_long_is_caught_up_with(clock: Clock) -> None:
    keeper = Pace()
    first = run(keeper, clock, since_ns=0, work_s=0.0)
    assert run(keeper, clock, since_ns=4_000_000, work_s=0.010) == pytest.approx(first + 0.010)
    assert run(keeper, clock, since_ns=8_000_000, work_s=0.001) == pytest.approx(first + 0.011)
    assert run(keeper, clock, since_ns=12_000_000, work_s=0.001) == pytest.approx(first + 0.012)


@pytest.mark.parametrize(
    ("since_ns", "pause_s", "factor"), [(4_000_000, 1.0, 1.0), (0, 0.0, 1.0), (50_000_000, 0.0, 1.0)]
)
def test_after_a_rest_or_a_reset_pace_is_kept_from_the_present_time(
    since_ns: int, pause_s: float, factor: float, clock: Clock
) -> None:
    keeper = Pace()
    run(keeper, clock, since_ns=0, work_s=0.030)
    clock.now += pause_s
    assert run(keeper, clock, since_ns=since_ns, work_s=0.0, factor=factor) - clock.now == 0
    began_s = clock.now
    assert run(keeper, clock, since_ns=since_ns + 4_000_000, work_s=0.0, factor=factor) == pytest.approx(
        began_s + 0.004
    )


def test_a_stretch_in_slow_motion_takes_longer(clock: Clock) -> None:
    began_s = clock.now
    assert run(Pace(), clock, since_ns=0, work_s=0.0, factor=0.1) == pytest.approx(began_s + 0.040)
