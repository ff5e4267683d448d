import signal
from collections.abc import Iterator

import pytest

from throwcollect.cli.interruptions import count_interruptions


@pytest.fixture
def heeds_hangups() -> Iterator[None]:
    """Whatever these tests were started by: `nohup` has it ignored."""
    before = signal.signal(signal.SIGHUP, signal.SIG_DFL)
    yield
    signal.signal(signal.SIGHUP, before)


@pytest.mark.usefixtures("heeds_hangups")
def test_signals_are_counted_and_then_what_they_were() -> None:
    before = signal.getsignal(signal.SIGINT), signal.getsignal(signal.SIGTERM)
    with count_interruptions() as interruptions:
        assert interruptions() == 0
        signal.raise_signal(signal.SIGINT)
        signal.raise_signal(signal.SIGTERM)
        signal.raise_signal(signal.SIGHUP)
        assert interruptions() == 3
    assert (signal.getsignal(signal.SIGINT), signal.getsignal(signal.SIGTERM)) == before


def test_a_hangup_that_is_ignored_stays_so() -> None:
    before = signal.signal(signal.SIGHUP, signal.SIG_IGN)
    try:
        with count_interruptions() as interruptions:
            signal.raise_signal(signal.SIGHUP)
            assert interruptions() == 0
    finally:
        signal.signal(signal.SIGHUP, before)
