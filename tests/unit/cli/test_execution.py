"""What a user of a command reads when it fails."""

from __future__ import annotations

import errno
import os
import signal
import subprocess
import sys
import tempfile
from pathlib import Path
from types import SimpleNamespace

import pytest

from throwcollect.arguments import refuse_argument
from throwcollect.cli.execution import execute
from throwcollect.cli.main import assemble_command
from throwcollect.errors import ConfigError, NotFoundError, Problem


def describe(error: Exception, capsys: pytest.CaptureFixture[str], *, code: int = 2) -> str:
    """The message of a command that fails with this error."""

    def fail(**_: object) -> None:
        raise error

    with pytest.raises(SystemExit) as ended:
        execute(fail)
    assert ended.value.code == code
    return capsys.readouterr().err


@pytest.mark.parametrize(("argument", "option"), [("where", "--where"), ("rate_hz", "--rate")])
def test_an_error_about_an_argument_names_its_command_line_option(
    argument: str, option: str, capsys: pytest.CaptureFixture[str]
) -> None:
    error = refuse_argument(argument, "got 'a'", expected="b", hint="c")
    assert str(error).startswith(f"{argument}: got 'a'")
    assert describe(error, capsys) == f"throwcollect: {option}: got 'a'\n  expected: b\n  try: c\n"


def test_an_error_about_a_configuration_key_names_the_key_unchanged(capsys: pytest.CaptureFixture[str]) -> None:
    both = NotFoundError([Problem("is not there", "task.end"), Problem("is not there", "seed", argument=True)])
    assert describe(both, capsys) == "throwcollect: task.end: is not there\n--seed: is not there\n"
    assert describe(ConfigError("no target"), capsys) == "throwcollect: no target\n"


def test_a_machine_without_a_directory_for_temporary_files_is_told_what_to_name(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(tempfile, "tempdir", None)
    monkeypatch.setattr(tempfile, "_candidate_tempdir_list", lambda: ["/proc/nowhere"])
    with pytest.raises(FileNotFoundError) as caught:
        tempfile.gettempdir()
    said = "throwcollect: no directory for temporary files can be written\n  try: name one in TMPDIR\n"
    assert describe(caught.value, capsys) == said


@pytest.mark.parametrize(
    ("error", "said"),
    [
        (MemoryError(), "out of memory"),
        (OSError(errno.ENOMEM, "Cannot allocate memory"), "out of memory"),
        (ImportError("libarrow.so: failed to map segment from shared object"), "out of memory"),
        (OSError(errno.EMFILE, "Too many open files", "/dev/null"), "too many open files"),
    ],
)
def test_a_limit_of_the_process_is_named(error: Exception, said: str, capsys: pytest.CaptureFixture[str]) -> None:
    told = describe(error, capsys, code=3)
    assert told.startswith(f"throwcollect: {said}\n  try: ")
    assert "ulimit -" in told


@pytest.mark.parametrize("now", [-1.0, 2.0**31, None])
def test_a_clock_that_records_cannot_hold_is_refused(
    now: float | None, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    def read_clock() -> float:
        if now is None:
            raise OverflowError("timestamp too large to convert to C _PyTime_t")
        return now

    monkeypatch.setattr("throwcollect.cli.execution.time", SimpleNamespace(time=read_clock))
    assert "the clock of this machine" in describe(RuntimeError("unused"), capsys)


GONE = "throwcollect: the current directory cannot be used: No such file or directory\n  try: go to another one\n"


def test_a_current_directory_that_is_removed_during_a_command_is_named(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "gone").mkdir()
    monkeypatch.chdir(tmp_path / "gone")

    def fail(**_: object) -> None:
        (tmp_path / "gone").rmdir()
        os.getcwd()

    with pytest.raises(SystemExit) as ended:
        execute(fail)
    assert (ended.value.code, capsys.readouterr().err) == (2, GONE)


@pytest.mark.parametrize(("command", "code"), [("sim", 0), ("up", 2)])
def test_only_processes_of_a_run_start_in_a_directory_that_is_gone(
    command: str, code: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "gone").mkdir()
    monkeypatch.chdir(tmp_path / "gone")
    (tmp_path / "gone").rmdir()
    monkeypatch.setattr(sys, "argv", ["throwcollect", command])
    with pytest.raises(SystemExit) as ended:
        execute(lambda **_: 0)
    assert ended.value.code == code


def test_a_lack_of_memory_is_told_in_a_sentence(capsys: pytest.CaptureFixture[str]) -> None:
    assert describe(MemoryError(), capsys, code=3).startswith("throwcollect: out of memory\n  try: ")


@pytest.mark.parametrize("numbers", [["1.4", "-0.2"], ["1.4", "0.2"], ["1.4", "-.2"], ["1.4", "0.2", "0.1"]])
def test_numbers_of_a_target_without_a_comma_are_told_how_they_are_written(
    numbers: list[str], capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(sys, "argv", ["throwcollect", "aim", "model", "--at", *numbers])
    with pytest.raises(SystemExit):
        execute(assemble_command("aim"))
    said = capsys.readouterr().err
    assert "\n  expected: commas between the numbers, such as --at 1.4,-0.2\n  try: throwcollect aim --help\n" in said


def test_a_wrong_option_of_a_command_with_targets_is_not_taken_for_a_number(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(sys, "argv", ["throwcollect", "aim", "model", "--foo"])
    with pytest.raises(SystemExit):
        execute(assemble_command("aim"))
    assert "commas" not in capsys.readouterr().err


def test_an_interruption_that_python_has_wrapped_is_none_of_our_errors(capsys: pytest.CaptureFixture[str]) -> None:
    error = RuntimeError("Error calling __set_name__ on 'Field' instance")
    error.__cause__ = KeyboardInterrupt()
    assert describe(error, capsys, code=130) == "throwcollect: interrupted\n"


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_after_the_end_of_a_command_changes_nothing(number: signal.Signals) -> None:
    program = (
        "import atexit, signal; from throwcollect.cli.execution import execute; "
        f"atexit.register(signal.raise_signal, {int(number)}); execute(lambda **_: print('done') or 0)"
    )
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout, done.stderr) == (0, "done\n", "")
