"""Which Python `make up` and `make test` take."""

import shutil
import subprocess
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
