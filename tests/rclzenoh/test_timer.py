import pytest

from rclzenoh.time import ROSClock, Time, Timer


@pytest.fixture
def clock():
    clock = ROSClock()
    clock.activate(True)
    return clock


def at(clock, nanoseconds):
    clock.set_ros_time_override(Time(nanoseconds=nanoseconds))


def test_a_timer_is_due_after_its_period(clock):
    timer = Timer(lambda: None, 100, clock)
    at(clock, 99)
    assert timer.time_until_next_call() == 1
    at(clock, 100)
    assert timer.time_until_next_call() == 0
    timer.advance()
    assert timer.time_until_next_call() == 100


def test_missed_periods_are_skipped_and_the_phase_is_kept(clock):
    timer = Timer(lambda: None, 100, clock)
    at(clock, 350)
    timer.advance()
    assert timer.time_until_next_call() == 50


def test_a_clock_that_jumps_back_starts_a_new_period(clock):
    at(clock, 10_000)
    timer = Timer(lambda: None, 100, clock)
    at(clock, 50)
    assert timer.time_until_next_call() == 100
