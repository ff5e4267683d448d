"""Which Python `make up` and `make test` take."""

import os
import runpy
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
SCRIPT = ROOT / "packaging" / "environment.sh"


@pytest.fixture
def commands(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The only directory in the path; each command in it is a script that prints its arguments."""
    directory = tmp_path / "commands"
    directory.mkdir()
    (directory / "sh").symlink_to(shutil.which("sh") or "/bin/sh")
    monkeypatch.setenv("PATH", str(directory))
    return directory


def put(
    directory: Path,
    name: str,
    *,
    version: str = "3.11",
    fast: bool = False,
    makes: bool = True,
    pip: str = "exit 1",
    fetch: str = "exit 1",
    ends: str = "exit 0",
) -> None:
    """A command that tells of itself, and if it is asked with `-c`, whether its version is in the range asked for.

    Args:
        directory: Where it lies.
        name: Its name.
        version: Its version.
        fast: Whether it was compiled with optimisation.
        makes: Whether it has the modules that make environments.
        pip: What it does as pip.
        fetch: What it does with `fetch_uv.py`.
        ends: How it ends otherwise.
    """
    path = directory / name
    path.write_text(
        f"""#!/bin/sh
case "$1$2$3" in
    -c*ensurepip*) {":" if makes else "exit 1"} ;;
esac
case "$1$2$3" in
    -c*enable-optimizations*) {"exit 0" if fast else "exit 1"} ;;
    -c*"(3, 10) <= sys.version_info < (3, 15)"*) case {version} in 3.1?) exit 0 ;; *) exit 1 ;; esac ;;
    -c*"(3, 10) <= sys.version_info < (3, 12)"*) case {version} in 3.10|3.11) exit 0 ;; *) exit 1 ;; esac ;;
    -c*) case {version} in 3.12|3.13|3.14) exit 0 ;; *) exit 1 ;; esac ;;
    -mpipinstall) {pip} ;;
    */fetch_uv.py*) {fetch} ;;
esac
echo "{name}" "$@"
{ends}
"""
    )
    path.chmod(0o755)


def make_environment(*arguments: str, cwd: Path | None = None) -> tuple[int, str, str]:
    words = [SCRIPT, "there", *arguments]
    done = subprocess.run(words, capture_output=True, text=True, timeout=60, check=False, cwd=cwd)
    return done.returncode, done.stdout, done.stderr


def test_the_first_python_with_wheels_makes_the_environment(commands: Path) -> None:
    put(commands, "python3.11", version="3.9")
    put(commands, "python3.10", version="3.10")
    put(commands, "python3")
    put(commands, "uv")
    code, out, _ = make_environment()
    assert (code, out.splitlines()[-1]) == (0, "python3.10 -m venv there")


def test_of_several_pythons_an_optimised_one_makes_the_environment(
    commands: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    slow, second, cannot = (tmp_path / name for name in ("slow", "also fast", "cannot"))
    for directory in (slow, second, cannot):
        directory.mkdir()
    put(slow, "python3.11")
    put(cannot, "python3.11", fast=True, makes=False)
    monkeypatch.setenv("PATH", f"{slow}:{cannot}::{second}:{commands}")
    assert make_environment()[1].splitlines()[-1] == "python3.11 -m venv there"
    put(second, "python3.11", fast=True)
    put(commands, "python3.11", fast=True)
    told, made = make_environment()[1].splitlines()
    assert told.endswith(f" of {second}")
    assert made == "python3.11 -m venv there"
    assert make_environment(str(slow / "python3.11"))[1].splitlines()[-1] == made
    assert str(second) not in make_environment(str(slow / "python3.11"))[1]


@pytest.mark.parametrize(
    ("prefix", "options", "header", "chosen"),
    [
        ("/usr", "'--prefix=/usr'", "Python.h", True),
        ("/opt", "'--prefix=/opt' '--enable-optimizations'", "Python.h", True),
        ("/opt", "'--prefix=/opt'", "Python.h", False),
        ("/usr", "'--prefix=/usr'", "another.h", False),
    ],
)
def test_a_python_is_preferred_if_it_was_compiled_with_optimisation_and_has_headers(
    prefix: str, options: str, header: str, chosen: bool, commands: Path, tmp_path: Path
) -> None:
    (tmp_path / header).touch()
    (tmp_path / "sitecustomize.py").write_text(
        f"import sys, sysconfig\nsys.base_prefix = {prefix!r}\n"
        f"sysconfig.get_config_vars()['CONFIG_ARGS'] = {options!r}\n"
        f"sysconfig.get_path = lambda name: {str(tmp_path)!r}\n"
    )
    python = commands / "python3.11"
    python.write_text(f'#!/bin/sh\n[ "$1" != -c ] || PYTHONPATH={tmp_path} exec {sys.executable} "$@"\necho "$@"\n')
    python.chmod(0o755)
    told, made = make_environment()[1].splitlines()
    assert told.endswith(f" of {commands}") == chosen
    assert made == "-m venv there"


def test_without_a_suitable_python_uv_fetches_one(commands: Path) -> None:
    put(commands, "python3", version="3.13")
    put(commands, "uv")
    code, out, _ = make_environment()
    assert (code, out.splitlines()) == (
        0,
        ["uv venv --quiet --seed --python 3.11 there", "environment: there, with Python 3.11 by uv"],
    )


@pytest.mark.parametrize("finished", [True, False])
def test_an_unfinished_environment_is_removed_before_uv_makes_one(
    commands: Path, tmp_path: Path, finished: bool
) -> None:
    (commands / "rm").symlink_to(shutil.which("rm") or "/bin/rm")
    put(commands, "uv")
    (tmp_path / "there" / "bin").mkdir(parents=True)
    (tmp_path / "there" / "pyvenv.cfg").touch()
    if finished:
        (tmp_path / "there" / "bin" / "python").touch()
    code, out, _ = make_environment(cwd=tmp_path)
    assert (code, out.splitlines()[0]) == (0, "uv venv --quiet --seed --python 3.11 there")
    assert (tmp_path / "there").exists() == finished


@pytest.mark.parametrize("by", ["pip", "fetch"])
def test_a_missing_uv_is_fetched_by_pip_or_else_by_a_script(commands: Path, tmp_path: Path, by: str) -> None:
    for name in ("mkdir", "chmod", "cat"):
        (commands / name).symlink_to(shutil.which(name) or f"/bin/{name}")
    fetched = """mkdir -p build/uv/bin; echo 'echo "uv $*"' > build/uv/bin/uv; chmod +x build/uv/bin/uv; exit 0"""
    put(commands, "python3", version="3.12", makes=by == "pip", **{by: fetched})
    code, out, _ = make_environment(cwd=tmp_path)
    assert (code, out.splitlines()[1:]) == (
        0,
        ["uv venv --quiet --seed --python 3.11 there", "environment: there, with Python 3.11 by uv"],
    )
    assert out.startswith("no Python 3.10 or 3.11 is here that makes environments; uv, which does, is in build/uv")


@pytest.mark.parametrize(("version", "told"), [("3.13", ", for which pybullet has no wheel: "), ("3.11", "")])
def test_uv_makes_the_environment_of_a_python_without_venv(commands: Path, version: str, told: str) -> None:
    put(commands, "python3", version=version, makes=False)
    put(commands, "uv")
    code, out, _ = make_environment("python3")
    by_uv, environment = out.splitlines()
    assert (code, by_uv) == (0, "uv venv --quiet --seed --python python3 there")
    assert environment.partition(" by uv")[2].startswith(told)
    assert bool(told) == ("MuJoCo" in environment)


def test_the_newest_uv_for_this_machine_is_chosen() -> None:
    names = [
        "uv-0.9.9-py3-none-manylinux_2_17_x86_64.manylinux2014_x86_64.whl",
        "uv-0.13.2-py3-none-manylinux_2_17_x86_64.manylinux2014_x86_64.whl",
        "uv-0.13.2-py3-none-musllinux_1_1_x86_64.whl",
        "uv-0.13.2-py3-none-macosx_11_0_arm64.whl",
        "uv-0.13.2-py3-none-win_amd64.whl",
        "uv-0.13.2.tar.gz",
        "uv-0.14.0-py3-none-manylinux_2_17_x86_64.manylinux2014_x86_64.whl",
        "uv-1.0.0rc1-py3-none-manylinux_2_17_x86_64.manylinux2014_x86_64.whl",
    ]
    files = [{"filename": name, "yanked": "0.14" in name} for name in names]
    find = runpy.run_path(str(SCRIPT.with_name("fetch_uv.py")))["find_wheel"]
    assert find(files, "Linux", "x86_64", False) == files[1]
    assert find(files, "Linux", "x86_64", True) == files[2]
    assert find(files, "Darwin", "arm64", False) == files[3]
    assert find(files, "Linux", "riscv64", False) is None
    assert find(files, "Windows", "AMD64", False) is None


@pytest.mark.parametrize("uv", [False, True])
def test_mujoco_simulates_if_uv_is_missing_or_fetches_no_python(commands: Path, tmp_path: Path, uv: bool) -> None:
    put(commands, "python3", version="3.13")
    if uv:
        put(commands, "uv", ends="echo 'error: x\n  cause: y https://z\n  cause: no name' >&2; exit 2")
    code, out, err = make_environment(cwd=tmp_path)
    *before, told, made_with = out.splitlines()
    assert (code, made_with, err) == (0, "python3 -m venv there", "")
    assert before == (
        ["uv venv --quiet --seed --python 3.11 there", "uv cannot have Python 3.11: no name"] if uv else []
    )
    assert "for which pybullet has no wheel: MuJoCo simulates" in told


def test_a_named_python_is_the_only_candidate(commands: Path) -> None:
    put(commands, "python3.11")
    put(commands, "python3.9", version="3.9")
    put(commands, "python3.12", version="3.12")
    put(commands, "uv")
    code, _, err = make_environment("python3.9")
    assert code == 1
    assert err.startswith("python3.9 is ")
    assert "from 3.10 to 3.14" in err
    assert make_environment("python3.8") == (1, "", "there is no python3.8 here: make PYTHON=/path/to/python3.11\n")
    put(commands, "python3.13", version="3.13", makes=False)
    (commands / "uv").unlink()
    assert make_environment("python3.13")[2].startswith(
        "no Python from 3.10 to 3.14 that can make environments is here (python3.13)"
    )
    assert "python3.12 -m venv there" in make_environment("python3.12")[1]
    assert "python3.11 -m venv there" in make_environment("python3.11")[1]
    for version in ("3.11", "3.12"):
        blank = commands / "of somebody"
        blank.mkdir(exist_ok=True)
        put(blank, f"python{version}", version=version)
        assert f"python{version} -m venv there" in make_environment(str(blank / f"python{version}"))[1]


def test_without_python_and_uv_the_script_fails_with_one_sentence(commands: Path) -> None:
    code, out, err = make_environment()
    assert (code, out, err.count("\n")) == (1, "", 1)
    assert err.startswith("no Python from 3.10 to 3.14 that can make environments is here (python3.11, python3.10,")
    assert "make PYTHON=" in err


def test_a_real_python_that_is_too_old_is_refused(tmp_path: Path) -> None:
    pythons = [name for name in ("python3.8", "python3.9") if works(name)]
    if not pythons:
        pytest.skip("no Python before 3.10 is here")
    for python in pythons:
        assert make_environment(python, cwd=tmp_path)[0] == 1, python
    assert not (tmp_path / "there").exists()


@pytest.mark.parametrize("target", ["up", "check"])
def test_make_runs_the_environment_script_first(target: str, tmp_path: Path) -> None:
    shutil.copy(ROOT / "Makefile", tmp_path)
    (tmp_path / "pyproject.toml").touch()
    said = subprocess.run(
        ["make", "-n", target, "PYTHON=python3.12"],
        cwd=tmp_path,
        # This `make` must not count as part of the one that may run the tests.
        env={name: value for name, value in os.environ.items() if not name.startswith("MAKE")},
        capture_output=True,
        text=True,
        check=True,
    )
    first, *others = said.stdout.splitlines()
    assert first == 'packaging/environment.sh .venv "python3.12"'
    (install,) = [line for line in others if " -e " in line]
    assert install.startswith("packaging/install.sh .venv/bin/python -e ")


@pytest.mark.parametrize("version", [(3, 10, 13), (3, 12, 1)])
def test_the_tests_are_not_installed_for_another_python_than_theirs(
    version: tuple[int, int, int], tmp_path: Path
) -> None:
    shutil.copy(ROOT / "Makefile", tmp_path)
    (tmp_path / "pyproject.toml").touch()
    python = tmp_path / ".venv" / "bin" / "python"
    python.parent.mkdir(parents=True)
    pretends = f"import sys; sys.version_info = {version}; exec(sys.argv[1])"
    python.write_text(f'#!/bin/sh\nexec {sys.executable} -c "{pretends}" "$2"\n')
    python.chmod(0o755)
    environment = {name: value for name, value in os.environ.items() if not name.startswith("MAKE")}
    words = ["make", "--silent", ".venv/.ready-dev"]
    said = subprocess.run(words, cwd=tmp_path, env=environment, capture_output=True, text=True, check=False)
    assert (said.returncode, said.stdout) == (2, "")
    assert said.stderr.startswith("the tests need Python 3.11, the only one")


def test_an_environment_with_another_python_than_the_named_one_is_not_used(tmp_path: Path) -> None:
    shutil.copy(ROOT / "Makefile", tmp_path)
    (tmp_path / "pyproject.toml").touch()
    binaries = tmp_path / ".venv" / "bin"
    binaries.mkdir(parents=True)
    pythons = {binaries / "python": "3.11.2", tmp_path / "same": "3.11.2", tmp_path / "other": "3.12.1"}
    for path, version in pythons.items():
        path.write_text(f"#!/bin/sh\n[ $1 != -V ] || echo Python {version}\n")
        path.chmod(0o755)
    (tmp_path / "old").write_text("#!/bin/sh\n[ $1 = -V ] && echo Python 3.9.2\n")
    (tmp_path / "old").chmod(0o755)
    (binaries / "throwcollect").write_text("#!/bin/sh\necho collects\n")
    (binaries / "throwcollect").chmod(0o755)
    (tmp_path / ".venv" / ".ready").touch()

    def make_up(*named: str) -> subprocess.CompletedProcess[str]:
        environment = {name: value for name, value in os.environ.items() if not name.startswith("MAKE")}
        words = ["make", "--silent", "up", *named]
        return subprocess.run(words, cwd=tmp_path, env=environment, capture_output=True, text=True, check=False)

    (tmp_path / "of somebody").mkdir()
    (tmp_path / "of somebody" / "python").symlink_to(tmp_path / "same")
    for named in ((), ("PYTHON=./same",), ("PYTHON=./of somebody/python",), ("PYTHON=~/same", f"HOME={tmp_path}")):
        assert make_up(*named).stdout.startswith("collects\n")
    refused = make_up("PYTHON=./other")
    assert (refused.returncode != 0, refused.stdout) == (True, "")
    assert refused.stderr.startswith(".venv has Python 3.11.2, not that of ./other: rm -r .venv, then make up")
    # The advice to remove .venv would be wrong for a Python that would then be refused.
    for unfit in ("./old", "./nowhere"):
        refused = make_up(f"PYTHON={unfit}")
        assert (refused.returncode != 0, refused.stdout) == (True, "")
        assert refused.stderr.startswith(
            f".venv has Python 3.11.2, and {unfit} is no Python from 3.10 to 3.14: make up"
        )


@pytest.mark.parametrize(
    ("fails", "installs"),
    [
        ("nothing", "-m uv pip install --python {python} --only-binary pybullet -e .[collect]"),
        (
            "*install*uv*",
            "-m pip install --no-compile --disable-pip-version-check --only-binary=pybullet -e .[collect]",
        ),
        ("*uv*-e*", "-m pip install --no-compile --disable-pip-version-check --only-binary=pybullet -e .[collect]"),
    ],
    ids=["by uv", "uv cannot be had", "uv cannot install"],
)
def test_pip_installs_the_project_if_uv_is_missing_or_fails(fails: str, installs: str, tmp_path: Path) -> None:
    python = tmp_path / "python"
    python.write_text(f'#!/bin/sh\necho "$*"\ncase "$*" in {fails}) exit 1 ;; esac\n')
    python.chmod(0o755)
    command = [SCRIPT.with_name("install.sh"), python, "-e", ".[collect]"]
    done = subprocess.run(command, capture_output=True, text=True, timeout=60, check=False)
    assert done.returncode == 0
    assert done.stdout.splitlines()[-1] == installs.format(python=python)
    assert ("pip tries" in done.stderr) == (fails == "*uv*-e*")


def works(python: str) -> bool:
    if shutil.which(python) is None:
        return False
    return subprocess.run([python, "-c", ""], capture_output=True, check=False).returncode == 0
