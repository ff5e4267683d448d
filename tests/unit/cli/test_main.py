"""What a user of a command reads when it fails."""

from __future__ import annotations

import errno
import signal
import subprocess
import sys

import pytest

from throwcollect.cli.main import assemble, execute


def describe(error: Exception, capsys: pytest.CaptureFixture[str], *, code: int = 2) -> str:
    """The message of a command that fails with this error."""

    def fail(**_: object) -> None:
        raise error

    with pytest.raises(SystemExit) as ended:
        execute(fail)
    assert ended.value.code == code
    return capsys.readouterr().err


@pytest.mark.parametrize(
    ("error", "said", "code"),
    [
        (PermissionError(errno.EACCES, "Permission denied", "out"), "out: Permission denied\n", 2),
        (MemoryError(), "out of memory\n  try: ", 1),
    ],
)
def test_an_error_of_the_system_is_one_message_without_a_traceback(
    error: Exception, said: str, code: int, capsys: pytest.CaptureFixture[str]
) -> None:
    assert describe(error, capsys, code=code).startswith(f"throwcollect: {said}")


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_after_the_end_of_a_command_changes_nothing(number: signal.Signals) -> None:
    program = (
        "import atexit, signal; from throwcollect.cli.main import execute; "
        f"atexit.register(signal.raise_signal, {int(number)}); execute(lambda **_: print('done') or 0)"
    )
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout, done.stderr) == (0, "done\n", "")


def test_a_command_is_assembled_alone_and_an_unknown_word_gives_all() -> None:
    def list_names(*words: str) -> list[str]:
        app = assemble(*words)
        return [str(each.name) for each in [*app.registered_commands, *app.registered_groups]]

    assert [list_names(word) for word in ("join-run", "ros")] == [["join-run"], ["ros"]]
    assert list_names("nosuch") == list_names()
    assert {"up", "throw", "robot"} < set(list_names())
