"""Output whose readers leave. Each test needs a process of its own."""

import subprocess
import sys
from pathlib import Path

import pytest

PROLOGUE = """
import os, sys
from throwcollect.cli import streams
streams.open_streams()
def lose(number):
    reading, writing = os.pipe()
    os.dup2(writing, number)
    os.close(reading)
"""


def run(code: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-c", PROLOGUE + code],
        stdin=subprocess.DEVNULL,
        capture_output=True,
        text=True,
        timeout=60,
        check=False,
    )


@pytest.mark.parametrize(
    ("call", "said_last"),
    [
        ("streams.ensure_written(hint='look')", "OutputError: the output cannot be written: Broken pipe\n  try: look"),
        ("streams.ensure_written(reader_may_leave=True)", "goes on"),
    ],
)
def test_lost_output_is_an_error_unless_the_reader_may_leave(call: str, said_last: str) -> None:
    said = run(f"lose(1)\nprint(1, flush=True)\n{call}\nprint('goes on', file=sys.stderr)")
    assert said.stderr.rstrip().endswith(said_last)


@pytest.mark.parametrize(
    ("output", "read"),
    [
        ("os.dup2(os.pipe()[1], 1)", True),
        ("lose(1)", False),
        ("os.dup2(os.open(os.devnull, os.O_WRONLY), 1)", True),
        ("os.dup2(os.open('out.txt', os.O_WRONLY | os.O_CREAT), 1)", True),
        ("os.dup2(os.openpty()[1], 1)", True),
    ],
)
def test_has_reader_tells_without_writing_whether_the_reader_has_left(
    output: str, read: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    assert run(f"{output}\nprint(streams.has_reader(), file=sys.stderr)").stderr == f"{read}\n"


def test_messages_are_dropped_when_standard_error_has_no_reader() -> None:
    said = run("lose(2)\nfor _ in range(3): print('warning', file=sys.stderr)\nprint('done')")
    assert (said.returncode, said.stdout) == (0, "done\n")


def test_output_to_a_full_disk_is_an_error_even_if_the_reader_may_leave() -> None:
    said = run("os.dup2(os.open('/dev/full', os.O_WRONLY), 1)\nprint(1)\nstreams.ensure_written(reader_may_leave=True)")
    assert "OutputError: the output cannot be written: No space left on device" in said.stderr
    # Python does not try to write again when the process ends.
    assert "Exception ignored" not in said.stderr


def test_a_name_that_is_not_valid_utf_8_can_be_printed() -> None:
    assert run("print('a\\udcffb')").stdout == "a\\udcffb\n"
