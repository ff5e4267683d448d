"""The end of a process whose parent dies, and signals that are counted."""

import signal
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor

import pytest

from throwcollect.own_process import count_interruptions

CHILD = """
import os, sys, time
from throwcollect.own_process import die_with_parent

parent = os.getpid()
if os.fork():
    time.sleep({parent_lives_s})
    os._exit(0)
time.sleep({child_waits_s})
die_with_parent(parent)
print("goes on", flush=True)
time.sleep(1)
print("outlives its parent", flush=True)
"""


@pytest.mark.parametrize(
    ("parent_lives_s", "child_waits_s", "said"),
    [(0.5, 0.0, "goes on\n"), (0.0, 0.3, "")],
    ids=["a parent that dies later", "a parent that is dead already"],
)
def test_a_child_dies_with_its_parent_whenever_that_dies(
    parent_lives_s: float, child_waits_s: float, said: str
) -> None:
    program = CHILD.format(parent_lives_s=parent_lives_s, child_waits_s=child_waits_s)
    # `run` returns when no process has the output open any more, which is when the child has ended.
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, timeout=60, check=False)
    assert (done.stdout, done.stderr) == (said, "")


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


@pytest.mark.parametrize("number", [signal.SIGHUP, signal.SIGINT])
def test_a_signal_that_was_ignored_stays_ignored(number: signal.Signals) -> None:
    signal.signal(number, signal.SIG_IGN)
    with count_interruptions() as interruptions:
        signal.raise_signal(number)
        assert interruptions() == 0


def test_in_other_threads_no_signals_are_counted() -> None:
    def count() -> int:
        with count_interruptions() as interruptions:
            return interruptions()

    with ThreadPoolExecutor(1) as pool:
        assert pool.submit(count).result() == 0
