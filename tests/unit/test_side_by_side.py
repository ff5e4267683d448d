"""Work in several processes: results in order, and one message whatever happens to a process."""

from __future__ import annotations

import multiprocessing
import os
import signal
import subprocess
import sys
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest
from tests.unit.work_side_by_side import SlowlySent, begin, begin_badly, begin_death, begin_nap

from throwcollect.errors import ConfigError, WorkerError
from throwcollect.side_by_side import limit_processes, work_side_by_side, working_side_by_side

ASLEEP = """
import time
from work_side_by_side import begin_sleep
from throwcollect.side_by_side import work_side_by_side

if __name__ == "__main__":
    for piece in work_side_by_side(range(3), begin_sleep, (), processes=2, doing="sleeps", fork={fork}):
        print(piece, flush=True)
"""
FORKED = """
import os
import threading
import time
import work_side_by_side as work
from throwcollect.errors import WorkerError
from throwcollect.side_by_side import work_side_by_side

work.READ.append("read before")
for _ in range(2):
    found = list(work_side_by_side(range(4), work.begin_look, (), processes=2, doing="looks", fork=True))
    print([read for read, _ in found], os.getpid() in {process for _, process in found})
    threading.Thread(target=time.sleep, args=[600], daemon=True).start()
"""


def test_results_come_in_order_from_several_processes() -> None:
    found = list(work_side_by_side(range(40), begin, (3,), processes=2, doing="counts"))
    assert [number for number, _ in found] == [3 * piece for piece in range(40)]
    assert os.getpid() not in {process for _, process in found}
    assert multiprocessing.active_children() == []


def test_processes_that_the_caller_started_are_left_alone() -> None:
    found = work_side_by_side(range(4), begin, (3,), processes=2, doing="counts", fork=True)
    next(found)
    mine = multiprocessing.get_context("fork").Process(target=time.sleep, args=[60])
    mine.start()
    try:
        assert len(list(work_side_by_side(range(4), begin, (3,), processes=2, doing="counts", fork=True))) == 4
        assert len(list(found)) == 3
        mine.join(0.3)
        assert mine.exitcode is None
    finally:
        mine.kill()
        mine.join()


def test_two_threads_leave_the_processes_of_each_other_alone() -> None:
    before = dict(os.environ)

    def nap(duration_s: float) -> list[int]:
        return list(work_side_by_side(range(4), begin_nap, (SlowlySent(duration_s),), processes=2, doing="naps"))

    with ThreadPoolExecutor(2) as threads:
        # The thread that ends first must not end the processes of the other one.
        assert list(threads.map(nap, [0.0, 1.0])) == [[0, 1, 2, 3]] * 2
    assert dict(os.environ) == before


def test_one_process_or_one_piece_of_work_stays_in_the_caller() -> None:
    assert list(work_side_by_side([1, 2], begin, (1,), processes=1, doing="counts")) == [
        (1, os.getpid()),
        (2, os.getpid()),
    ]
    assert list(work_side_by_side([1], begin, (1,), processes=8, doing="counts")) == [(1, os.getpid())]
    assert list(work_side_by_side([], begin, (1,), processes=8, doing="counts")) == []


def test_an_exception_in_a_process_reaches_the_caller() -> None:
    with pytest.raises(ConfigError, match="nothing to begin with"):
        list(work_side_by_side(range(4), begin_badly, (), processes=2, doing="counts"))


@pytest.mark.parametrize("fork", [False, True])
def test_a_process_that_is_killed_is_named(fork: bool) -> None:
    with pytest.raises(WorkerError, match="a process that counts was killed"):
        list(work_side_by_side(range(40), begin_death, (), processes=2, doing="counts", fork=fork))


def test_processes_start_before_results_are_read_and_end_with_the_block() -> None:
    with working_side_by_side(range(4), begin, (3,), processes=2, doing="counts") as found:
        processes = {process.pid for process in multiprocessing.active_children()}
        assert {process for _, process in found} <= processes
    assert multiprocessing.active_children() == []


def test_a_further_process_is_begun_only_for_enough_throws() -> None:
    assert [limit_processes(3, throws) for throws in (0, 39, 40, 59, 60, 1000)] == [1, 1, 2, 2, 3, 3]
    assert {pid for _, pid in work_side_by_side(range(40), begin, (3,), processes=1, doing="counts")} == {os.getpid()}


def test_processes_are_forked_off_one_without_other_threads_of_python() -> None:
    done = subprocess.run(
        [sys.executable, "-c", FORKED], capture_output=True, text=True, env=find_tests(), timeout=60, check=False
    )
    have, have_not = [["read before"]] * 4, [[]] * 4
    assert (done.stdout, done.stderr) == (f"{have} False\n{have_not} False\n", "")


def test_processes_do_not_import_the_program(tmp_path: Path) -> None:
    program = tmp_path / "program.py"
    program.write_text(
        "import work_side_by_side as work\n"
        "from throwcollect.side_by_side import work_side_by_side\n"
        "print(*[each for each, _ in work_side_by_side(range(4), work.begin, (3,), processes=2, doing='counts')])\n"
    )
    done = subprocess.run(
        [sys.executable, program], capture_output=True, text=True, env=find_tests(), timeout=60, check=False
    )
    assert (done.stdout, done.stderr) == ("0 3 6 9\n", "")


def find_tests() -> dict[str, str]:
    """The environment of a process that can import the module of its work."""
    paths = os.pathsep.join([os.path.dirname(__file__), *filter(None, [os.environ.get("PYTHONPATH")])])
    return {**os.environ, "PYTHONPATH": paths}


@pytest.mark.parametrize("fork", [False, True])
@pytest.mark.parametrize("how", [signal.SIGINT, signal.SIGKILL])
def test_all_processes_end_with_their_caller(how: signal.Signals, fork: bool) -> None:
    # The processes have a group of their own, as Ctrl-C reaches all processes of a terminal.
    with subprocess.Popen(
        [sys.executable, "-c", ASLEEP.format(fork=fork)],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
        env=find_tests(),
    ) as asking:
        assert asking.stdout is not None
        assert asking.stderr is not None
        asleep = {int(asking.stdout.readline()) for _ in range(2)}
        started = time.monotonic()
        if how == signal.SIGINT:
            os.killpg(asking.pid, how)
        else:
            asking.kill()
        asking.wait(timeout=60)
        while any(os.path.exists(f"/proc/{each}/cmdline") for each in asleep):
            assert time.monotonic() < started + 60
            time.sleep(0.02)
        told = asking.stderr.read() if how == signal.SIGINT else ""
    # Only the caller prints a traceback, and no other process does.
    assert told.count("Traceback") == (how == signal.SIGINT)
