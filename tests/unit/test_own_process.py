"""Commands of throwcollect are told from programs of users that import it."""

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

import throwcollect
from throwcollect.own_process import SERIAL_LIBRARIES, make_command

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


THREADS = """
import sys, types

def run_command():
    import numpy
    print(*(line for line in open("/proc/self/status") if line.startswith("Threads")))

# It stands for the command line.
sys.modules["throwcollect.cli.main"] = types.SimpleNamespace(main=run_command)
from throwcollect.__main__ import main

main()
"""


def test_numerical_libraries_start_no_threads_in_a_command() -> None:
    environment = {name: value for name, value in os.environ.items() if name not in SERIAL_LIBRARIES}
    words = [sys.executable, "-c", THREADS]
    done = subprocess.run(words, env=environment, capture_output=True, text=True, check=True)
    assert done.stdout.split() == ["Threads:", "1"]


@pytest.mark.parametrize("version", [(3, 10), (3, 11)])
def test_a_command_imports_no_module_from_the_working_directory(
    version: tuple[int, int], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name in ("queue", "types", "runpy", "signal", "numpy", "throwcollect"):
        (tmp_path / f"{name}.py").write_text("raise SystemExit('a file of the working directory was run')\n")
    monkeypatch.setattr(sys, "version_info", version)
    for words in (["--version"], ["simulate", "--help"]):
        done = subprocess.run([*make_command(), *words], cwd=tmp_path, capture_output=True, text=True, check=False)
        assert (done.returncode, done.stderr) == (0, "")
        assert "throwcollect" in done.stdout


def test_only_own_process_builds_commands_of_the_interpreter() -> None:
    sources = Path(throwcollect.__file__).parent.rglob("*.py")
    asked = {path.name for path in sources if re.search(r'sys\.executable, "-[mc]"', path.read_text(encoding="utf-8"))}
    # `node_server.py` only writes such words as the title of a process, for `ps`.
    assert asked == {"own_process.py", "node_server.py"}


@pytest.mark.parametrize(("claims", "kept"), [("pass", False), ("claim_process()", True)])
def test_only_the_objects_of_a_command_are_kept_from_the_garbage_collector(claims: str, kept: bool) -> None:
    asks = f"import gc; from throwcollect.own_process import *; {claims}; keep_objects(); print(gc.get_freeze_count())"
    done = subprocess.run([sys.executable, "-c", asks], capture_output=True, text=True, check=True)
    assert (int(done.stdout) > 0) == kept
