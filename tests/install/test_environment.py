"""Which Python `make up` and `make test` take."""

import os
import shutil
import subprocess
import time
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
SCRIPT = ROOT / "packaging" / "environment.sh"


@pytest.fixture
def commands(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The only directory with commands; each is a script that writes down what it was called with."""
    directory = tmp_path / "commands"
    directory.mkdir()
    (directory / "sh").symlink_to(shutil.which("sh") or "/bin/sh")
    monkeypatch.setenv("PATH", str(directory))
    return directory


def put(directory: Path, name: str, *, suits: bool = True) -> None:
    """A command that says whether it suits when it is asked with `-c`, and otherwise tells of itself."""
    path = directory / name
    path.write_text(f'#!/bin/sh\n[ "$1" = -c ] && exit {int(not suits)}\necho "{name}" "$@"\n')
    path.chmod(0o755)


def made(*arguments: str) -> tuple[int, str, str]:
    done = subprocess.run([SCRIPT, "there", *arguments], capture_output=True, text=True, timeout=60, check=False)
    return done.returncode, done.stdout, done.stderr


def test_the_first_python_with_wheels_is_taken(commands: Path) -> None:
    put(commands, "python3.11", suits=False)
    put(commands, "python3.10")
    put(commands, "python3")
    put(commands, "uv")
    code, out, _ = made()
    assert (code, out.splitlines()[-1]) == (0, "python3.10 -m venv there")


def test_where_no_python_suits_uv_fetches_one(commands: Path) -> None:
    put(commands, "python3", suits=False)
    put(commands, "uv")
    code, out, _ = made()
    assert (code, out.splitlines()[-1]) == (0, "uv venv --quiet --seed --python 3.11 there")


def test_a_python_that_is_named_is_the_only_one_that_is_looked_at(commands: Path) -> None:
    put(commands, "python3.11")
    put(commands, "python3.12", suits=False)
    code, _, err = made("python3.12")
    assert code == 1
    assert "(python3.12)" in err
    put(commands, "uv")
    assert "uv venv" in made("python3.12")[1]
    assert "python3.11 -m venv there" in made("python3.11")[1]


def test_without_python_and_uv_one_sentence_says_so_at_once(commands: Path) -> None:
    began = time.monotonic()
    code, out, err = made()
    assert (code, out, err.count("\n")) == (1, "", 1)
    assert err.startswith(
        "no Python 3.10 or 3.11 is here (python3.11, python3.10, python3), and pybullet has wheels for"
    )
    assert "make PYTHON=" in err
    assert time.monotonic() - began < 1 + 0.5 * os.getloadavg()[0]


def test_a_genuine_python_is_judged_by_its_version(tmp_path: Path) -> None:
    pythons = [name for name in ("python3.9", "python3.12", "python3.13") if works(name)]
    if not pythons:
        pytest.skip("no Python but 3.10 and 3.11 is here")
    if shutil.which("uv"):
        pytest.skip("uv would fetch another one")
    for python in pythons:
        assert made(python)[0] == 1, python
    assert not (tmp_path / "there").exists()


@pytest.mark.parametrize("target", ["up", "check"])
def test_make_uses_it_before_anything_else(target: str, tmp_path: Path) -> None:
    shutil.copy(ROOT / "Makefile", tmp_path)
    (tmp_path / "pyproject.toml").touch()
    said = subprocess.run(
        ["make", "-n", target, "PYTHON=python3.12"],
        cwd=tmp_path,
        # Not as a part of the `make` that may run the tests.
        env={name: value for name, value in os.environ.items() if not name.startswith("MAKE")},
        capture_output=True,
        text=True,
        check=True,
    )
    first, *others = said.stdout.splitlines()
    assert first == "packaging/environment.sh .venv python3.12"
    (install,) = [line for line in others if "pip install" in line and " -e " in line]
    assert "--only-binary=pybullet" in install
    assert "--quiet" not in install


def works(python: str) -> bool:
    if shutil.which(python) is None:
        return False
    return subprocess.run([python, "-c", ""], capture_output=True, check=False).returncode == 0
