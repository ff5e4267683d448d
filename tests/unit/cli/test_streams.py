"""Output whose readers leave. Each test needs a process of its own."""

import subprocess
import sys

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


def test_output_to_a_full_disk_is_an_error_even_if_the_reader_may_leave() -> None:
    said = run("os.dup2(os.open('/dev/full', os.O_WRONLY), 1)\nprint(1)\nstreams.ensure_written(reader_may_leave=True)")
    assert "OutputError: the output cannot be written: No space left on device" in said.stderr
    # Python does not try to write again when the process ends.
    assert "Exception ignored" not in said.stderr


def test_a_name_that_is_not_valid_utf_8_can_be_printed() -> None:
    assert run("print('a\\udcffb')").stdout == "a\\udcffb\n"
