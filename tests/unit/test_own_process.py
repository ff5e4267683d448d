"""Commands of throwcollect are told from programs of users that import it."""

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

import throwcollect
from throwcollect.own_process import SERIAL_LIBRARIES, make_command

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
    for words in (["--version"], ["router", "--help"]):
        done = subprocess.run([*make_command(), *words], cwd=tmp_path, capture_output=True, text=True, check=False)
        assert (done.returncode, done.stderr) == (0, "")
        assert "throwcollect" in done.stdout


def test_only_own_process_builds_commands_of_the_interpreter() -> None:
    sources = Path(throwcollect.__file__).parent.rglob("*.py")
    asked = {path.name for path in sources if re.search(r'sys\.executable, "-[mc]"', path.read_text(encoding="utf-8"))}
    assert asked == {"own_process.py"}
