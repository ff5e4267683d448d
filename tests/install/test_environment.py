"""Which Python and packages `make up` and `make test` take; Pythons, pip and uv are stand-ins."""

from __future__ import annotations

import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
SCRIPT = ROOT / "packaging" / "environment.sh"
LOCK = (ROOT / "uv.lock").read_text(encoding="utf-8")
PYTHON = """#!/bin/sh
minor={minor}
case "$*" in
    --version) echo "Python 3.$minor.0" ;;
    *fetch_uv.py*) {fetch} ;;
    -m*) echo "pip $*"; {pip} ;;
    *libgomp*) {libgomp} ;;
    *enable-optimizations*) {fast} ;;
    *"(3, 10) <= "*"< (3, 15)"*) [ $minor -ge 10 ] && [ $minor -lt 15 ] ;;
    *"(3, 10) <= "*"< (3, 12)"*) [ $minor = 10 ] || [ $minor = 11 ] ;;
    *"(3, 11) <= "*) [ $minor = 11 ] ;;
    *"(3, 12) <= "*) [ $minor -ge 12 ] && [ $minor -lt 15 ] ;;
esac
"""
UV = """#!/bin/sh
echo "uv $*"
case "$*" in
    venv*" 3.11 "*) mkdir -p there/bin; cp python3.11-of-uv there/bin/python ;;
    venv*) mkdir -p there/bin; cp "$(command -v "$5")" there/bin/python ;;
    python*) {installs} ;;
    sync*) {syncs} ;;
esac
"""


@pytest.fixture(autouse=True)
def commands(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The first directory in the path, which has uv; behind it are the few programs that the script calls."""
    directory, system = tmp_path / "commands", tmp_path / "system"
    directory.mkdir()
    system.mkdir()
    for name in ("sh", "rm", "mkdir", "cp", "chmod", "cat"):
        (system / name).symlink_to(str(shutil.which(name)))
    monkeypatch.setenv("PATH", f"{directory}:{system}")
    monkeypatch.chdir(tmp_path)
    put_uv(directory)
    put_python(tmp_path, "python3.11-of-uv", 11)
    return directory


def put(path: Path, text: str) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text)
    path.chmod(0o755)


def put_python(
    directory: Path,
    name: str,
    minor: int,
    *,
    fast: bool = False,
    libgomp: bool = True,
    pip: str = "exit 1",
    fetch: str = "exit 1",
) -> None:
    """Make a Python.

    Args:
        directory: Where it lies.
        name: Its name.
        minor: Its version, behind the 3.
        fast: Whether it was compiled with optimisation.
        libgomp: Whether it can load that library.
        pip: What it does as pip.
        fetch: What it does with `fetch_uv.py`.
    """
    values = {"minor": minor, "fast": f"{fast}".lower(), "libgomp": f"{libgomp}".lower(), "pip": pip, "fetch": fetch}
    put(directory / name, PYTHON.format(**values))


def put_uv(directory: Path, *, installs: str = "exit 0", syncs: str = "exit 0") -> None:
    put(directory / "uv", UV.format(installs=installs, syncs=syncs))


def make(named: str = "", *extras: str) -> subprocess.CompletedProcess[str]:
    words = ["sh", SCRIPT, "there", named, *(extras or ("collect",))]
    return subprocess.run(words, capture_output=True, text=True, timeout=60, check=False)


@pytest.mark.parametrize(
    ("pythons", "taken"),
    [
        ({"python3.11": 11, "python3.10": 10}, "python3.11"),
        ({"python3.11": 9, "python3.10": 10, "python3": 11}, "python3.10"),
        ({"python3": 13}, "3.11"),
        ({}, "3.11"),
    ],
)
def test_a_python_with_wheels_of_pybullet_is_taken_from_the_machine_or_else_from_uv(
    commands: Path, pythons: dict[str, int], taken: str
) -> None:
    for name, minor in pythons.items():
        put_python(commands, name, minor)
    done = make("", "collect", "serve")
    assert done.returncode == 0, done.stderr
    lines = [line for line in done.stdout.splitlines() if not line.startswith("installing")]
    assert lines[-3] == f"uv venv --quiet --seed --python {taken} there"
    assert lines[-2].startswith("environment: there, with Python 3.1")
    assert lines[-1] == "uv sync --locked --inexact --python there/bin/python --extra collect --extra serve"


def test_of_several_pythons_the_first_fast_one_is_taken(commands: Path, tmp_path: Path) -> None:
    put_python(commands, "python3.11", 11)
    put_python(tmp_path / "system", "python3.11", 11, fast=True)
    assert f"--python {tmp_path}/system/python3.11 there" in make().stdout


def test_mujoco_simulates_if_uv_fetches_no_python(commands: Path) -> None:
    put_uv(commands, installs="echo 'no server' >&2; exit 2")
    assert make().stderr.endswith("no server\nno Python from 3.10 to 3.14 is here: make PYTHON=/path/to/it\n")
    put_python(commands, "python3", 13)
    done = make()
    assert (done.returncode, done.stderr) == (0, "uv python install --quiet --no-bin 3.11\nno server\n")
    assert "there, with Python 3.13.0\npybullet has no wheel for it: MuJoCo simulates" in done.stdout


def test_a_named_python_is_the_only_candidate(commands: Path, tmp_path: Path) -> None:
    put_python(commands, "python3.11", 11)
    put_python(commands, "python3.9", 9)
    put_python(tmp_path / "has a blank", "python3.12", 12)
    assert make("python3.8").stderr == "there is no python3.8 here: make PYTHON=/path/to/python3.11\n"
    assert "is Python 3.9.0, and this needs a Python from 3.10 to 3.14" in make("python3.9").stderr
    assert "with Python 3.12.0" in make(str(tmp_path / "has a blank" / "python3.12")).stdout
    # What is there keeps its Python.
    assert "environment:" not in make().stdout
    assert "there has Python 3.12.0, not that of python3.11: rm -r there" in make("python3.11").stderr


def test_what_is_left_of_an_unfinished_environment_is_made_anew(commands: Path, tmp_path: Path) -> None:
    put_python(commands, "python3", 11)
    (tmp_path / "there").mkdir()
    (tmp_path / "there" / "pyvenv.cfg").touch()
    assert "environment: there, with Python 3.11.0" in make().stdout
    assert not (tmp_path / "there" / "pyvenv.cfg").exists()


def test_the_tests_need_one_version_of_python(commands: Path) -> None:
    put_python(commands, "python3", 11)
    put_python(commands, "python3.10", 10)
    assert make("python3", "dev").returncode == 0
    shutil.rmtree("there")
    done = make("python3.10", "dev")
    assert done.returncode == 1
    assert done.stderr.startswith("the tests need Python 3.11, the only one")


def test_a_missing_library_is_reported_before_anything_is_installed(commands: Path) -> None:
    put_python(commands, "python3", 11, libgomp=False)
    done = make()
    assert (done.returncode, "uv sync" in done.stdout) == (1, False)
    assert done.stderr.startswith("libgomp.so.1 is missing, which simulating needs: sudo apt install libgomp1")


@pytest.mark.parametrize("by", ["fetch", "pip", None])
def test_a_missing_uv_is_fetched_by_a_script_or_by_pip(commands: Path, tmp_path: Path, by: str | None) -> None:
    (commands / "uv").rename(tmp_path / "uv")
    fetched = "mkdir -p build/uv/bin; cp uv build/uv/bin/uv; exit 0"
    put_python(commands, "python3", 11, **({by: fetched} if by else {}))
    done = make()
    assert (done.returncode == 0) == ("uv venv --quiet" in done.stdout) == (by is not None)
    assert done.stderr.startswith("uv, which makes environments, cannot be fetched") == (by is None)


def test_pip_installs_the_same_versions_where_uv_cannot(commands: Path) -> None:
    put_uv(commands, syncs="exit 2")
    put_python(commands, "python3", 11, pip="exit 0")
    done = make()
    assert (done.returncode, done.stderr) == (0, "uv cannot install this; pip tries, from its own index\n")
    exported, *installed = done.stdout.splitlines()[-2:]
    pip = "pip -m pip install --no-compile --disable-pip-version-check"
    assert exported == f"{pip} --only-binary=:all: -r build/requirements.txt"
    assert installed == [f"{pip} --no-deps -e ."]


def test_the_lock_is_that_of_the_project_and_names_no_mirror() -> None:
    uv = [sys.executable, "-m", "uv", "--no-config", "--project", ROOT, "--offline", "lock", "--check"]
    subprocess.run(uv, check=True, capture_output=True)
    addresses = set(re.findall(r'"(\w+://[^/"]+/\w+)', LOCK))
    assert addresses == {"https://pypi.org/simple", "https://files.pythonhosted.org/packages"}


def test_the_uv_that_is_fetched_is_that_of_the_lock(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(str(SCRIPT.parent))
    from fetch_uv import find_wheel

    for machine, name in [
        (("Linux", "x86_64", False), "manylinux_2_17_x86_64.manylinux2014_x86_64"),
        (("Linux", "aarch64", True), "musllinux_1_1_aarch64"),
        (("Darwin", "arm64", True), "macosx_11_0_arm64"),
    ]:
        address, digest = find_wheel(LOCK, *machine)
        assert re.search(r"/uv-[\d.]+-py3-none-(.*)\.whl$", address)[1].endswith(name)
        assert f'"{address}", hash = "sha256:{digest}"' in LOCK
    assert find_wheel(LOCK, "Windows", "AMD64", False) is None
