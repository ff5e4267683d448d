"""Processes that are forked off a command: what they do not inherit, and how they end."""

import subprocess
import sys
import time

import psutil
import pytest

PROGRAM = """
import atexit, json, os, signal, sys
from functools import partial
from throwcollect.runtimes.forked_process import ForkedProcess

def work(writing):
    kept = sorted(int(name) for name in os.listdir("/proc/self/fd") if os.path.exists(f"/proc/self/fd/{{name}}"))
    told = {{
        "files": [number for number in kept if number != writing],
        "environment": dict(os.environ),
        "handlers": [signal.getsignal(each) is signal.SIG_DFL for each in (signal.SIGTERM, signal.SIGUSR1)],
        "session": os.getsid(0) == os.getpid(),
        "at its end": atexit._ncallbacks(),
    }}
    os.write(writing, json.dumps(told).encode())
    print("nobody reads this")
    atexit.register(print, "nor this")
    {end}

atexit.register(print, "the end of the parent")
signal.signal(signal.SIGTERM, lambda *_: None)
signal.signal(signal.SIGUSR1, lambda *_: None)
reading, writing = os.pipe()
held = open(os.devnull)
sys.stdout.write("written once\\n")
try:
    process = ForkedProcess(partial(work, writing), environment={{"ONLY": "this"}}, kept=writing)
    os.close(writing)
    print(os.read(reading, 10000).decode())
    print(process.wait())
finally:
    print("the block of the parent")
"""
TOLD = (
    '{"files": [0, 1, 2], "environment": {"ONLY": "this"}, "handlers": [true, true], "session": true, "at its end": 0}'
)


@pytest.mark.parametrize(
    ("end", "code"),
    [("return", 0), ("sys.exit(3)", 3), ("raise KeyError", 1), ("os.kill(os.getpid(), 9)", -9)],
    ids=["comes back", "exits", "fails", "is killed"],
)
def test_a_forked_process_inherits_nothing_and_runs_no_code_of_its_parent(end: str, code: int) -> None:
    done = subprocess.run(
        [sys.executable, "-c", PROGRAM.format(end=end)], capture_output=True, text=True, timeout=60, check=False
    )
    said = f"written once\n{TOLD}\n{code}\nthe block of the parent\nthe end of the parent\n"
    assert (done.stdout, done.stderr, done.returncode) == (said, "", 0)


ORPHAN = """
import os, time
from throwcollect.runtimes.forked_process import ForkedProcess

reading, writing = os.pipe()

def work():
    os.write(writing, b"lives")
    time.sleep(60)

process = ForkedProcess(work, environment={}, kept=writing)
os.read(reading, 5)
print(process.pid, flush=True)
os.kill(os.getpid(), 9)
"""


def test_a_forked_process_dies_with_its_parent() -> None:
    done = subprocess.run([sys.executable, "-c", ORPHAN], capture_output=True, text=True, timeout=60, check=False)
    assert done.returncode == -9
    deadline = time.monotonic() + 60
    while psutil.pid_exists(int(done.stdout)):
        assert time.monotonic() < deadline
        time.sleep(0.05)
