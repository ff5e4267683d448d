import signal

from throwcollect.cli.interruptions import count_interruptions


def test_signals_are_counted_and_their_handlers_restored_afterwards() -> None:
    # `nohup` starts the tests with this signal ignored.
    signal.signal(signal.SIGHUP, signal.SIG_DFL)
    before = signal.getsignal(signal.SIGINT), signal.getsignal(signal.SIGTERM)
    with count_interruptions() as interruptions:
        assert interruptions() == 0
        signal.raise_signal(signal.SIGINT)
        signal.raise_signal(signal.SIGTERM)
        signal.raise_signal(signal.SIGHUP)
        assert interruptions() == 3
    assert (signal.getsignal(signal.SIGINT), signal.getsignal(signal.SIGTERM)) == before


def test_a_hangup_signal_that_was_ignored_stays_ignored() -> None:
    signal.signal(signal.SIGHUP, signal.SIG_IGN)
    with count_interruptions() as interruptions:
        signal.raise_signal(signal.SIGHUP)
        assert interruptions() == 0
