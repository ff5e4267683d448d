"""What tells a command of ours from somebody's program."""

import subprocess
import sys

WHOSE = """
import sys, threading
from throwcollect.own_process import claim_process, may_be_forked

print(may_be_forked())
claim_process()
print(may_be_forked())
threading.Thread(target=sys.stdin.read, daemon=True).start()
print(may_be_forked())
"""


def test_only_a_command_without_further_threads_may_be_forked() -> None:
    words = [sys.executable, "-c", WHOSE]
    with subprocess.Popen(words, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as asked:
        assert asked.stdout is not None
        assert [asked.stdout.readline().strip() for _ in range(3)] == ["False", "True", "False"]
