import signal

from throwcollect.cli.interruptions import count_interruptions


def test_signals_are_counted_and_then_what_they_were() -> None:
    # Whoever starts the tests by `nohup` has it ignored.
    signal.signal(signal.SIGHUP, signal.SIG_DFL)
    before = signal.getsignal(signal.SIGINT), signal.getsignal(signal.SIGTERM)
    with count_interruptions() as interruptions:
        assert interruptions() == 0
        signal.raise_signal(signal.SIGINT)
        signal.raise_signal(signal.SIGTERM)
        signal.raise_signal(signal.SIGHUP)
        assert interruptions() == 3
    assert (signal.getsignal(signal.SIGINT), signal.getsignal(signal.SIGTERM)) == before


def test_a_hangup_that_is_ignored_stays_so() -> None:
    signal.signal(signal.SIGHUP, signal.SIG_IGN)
    with count_interruptions() as interruptions:
        signal.raise_signal(signal.SIGHUP)
        assert interruptions() == 0
