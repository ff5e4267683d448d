import pytest

from rclzenoh import time
from rclzenoh.time import Timer


@pytest.fixture
def now(monkeypatch):
    """Holder of the steady time [ns]."""
    now = [0]
    monkeypatch.setattr(time.system, "monotonic_ns", lambda: now[0])
    return now


def test_a_timer_is_due_after_its_period(now):
    timer = Timer(lambda: None, 100)
    now[0] = 99
    assert timer.time_until_next_call() == 1
    now[0] = 100
    assert timer.time_until_next_call() == 0
    timer.advance()
    assert timer.time_until_next_call() == 100


def test_missed_periods_are_skipped_and_the_phase_is_kept(now):
    timer = Timer(lambda: None, 100)
    now[0] = 350
    timer.advance()
    assert timer.time_until_next_call() == 50
