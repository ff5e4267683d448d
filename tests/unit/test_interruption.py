"""The end of a process whose parent dies."""

import subprocess
import sys

import pytest

CHILD = """
import os, sys, time
from throwcollect.interruption import die_with_parent

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
