"""Tries throwcollect with every Python that is here: `python packaging/try_pythons.py [VERSION ...]` prints a table.

For each version, `packaging/environment.sh` makes an environment, the extra `collect` is installed, and five throws
are collected with the engine that this Python has. Another environment with nothing but the light core reads them.
All directories have blanks in their names, and so has HOME. Interpreters are those of the path, of pyenv, or of uv.
"""

import os
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
VERSIONS = ("3.10", "3.11", "3.12", "3.13", "3.14")
LAST_WITH_BULLET = (3, 11)
READ = """
import sys, throwcollect
dataset = throwcollect.load(sys.argv[1])
landed = dataset.select("outcome == 'landed'")
assert len(landed) == 5, len(landed)
assert all(throw.events.landing.position.shape == (3,) and len(throw.joints.position) > 0 for throw in landed)
print(dataset.digest)
"""


@dataclass(frozen=True)
class Tried:
    """What came of one Python; times are wall times."""

    version: str
    light_s: float
    collect_s: float
    engine: str
    throws_s: float
    digest: str

    def row(self) -> str:
        """Its row of the table."""
        return (
            f"| {self.version} | {self.light_s:.0f} s | {self.collect_s:.0f} s | `{self.engine}` | "
            f"{self.throws_s:.1f} s | `{self.digest[:10]}` |"
        )


def find_python(version: str) -> str | None:
    """An interpreter of this version, in the path, of pyenv or of uv; None if there is none."""
    of_pyenv = Path(os.environ.get("PYENV_ROOT", Path.home() / ".pyenv")).glob(f"versions/{version}.*/bin/python")
    candidates = [shutil.which(f"python{version}"), *map(str, sorted(of_pyenv))]
    if uv := shutil.which("uv"):
        found = subprocess.run([uv, "python", "find", version], capture_output=True, text=True, check=False)
        candidates.append(found.stdout.strip())
    for python in candidates:
        # pyenv's entries of the path are there for versions that are not.
        if python and subprocess.run([python, "-c", "import venv"], capture_output=True, check=False).returncode == 0:
            return python
    return None


def run(words: list[str | Path], directory: Path, environment: Mapping[str, str]) -> str:
    """Runs a command in a directory and gives what it prints.

    Raises:
        SystemExit: It failed; what it printed stands in the message.
    """
    done = subprocess.run(words, cwd=directory, env=environment, capture_output=True, text=True, check=False)
    if done.returncode != 0:
        sys.exit(
            f"{' '.join(map(str, words))} ended with {done.returncode}:\n{done.stdout[-2000:]}\n{done.stderr[-2000:]}"
        )
    return done.stdout


def install(python: str, wheel: str, directory: Path, environment: Mapping[str, str]) -> float:
    """Makes an environment with a wheel and its extras, and says how long it took [s]."""
    began = time.monotonic()
    said = run([ROOT / "packaging" / "environment.sh", directory, python], directory.parent, environment)
    print(said.strip(), flush=True)
    pip: list[str | Path] = [directory / "bin" / "python", "-m", "pip", "install", "--quiet", "--no-compile"]
    run([*pip, "--disable-pip-version-check", "--only-binary=:all:", wheel], directory.parent, environment)
    return time.monotonic() - began


def try_python(version: str, python: str, wheel: Path, directory: Path) -> Tried:
    """Installs, collects and reads with one Python."""
    home = directory / "home of nobody"
    home.mkdir(parents=True)
    environment = {name: value for name, value in os.environ.items() if not name.startswith("PYTHON")}
    environment["HOME"] = str(home)
    collecting, reading = directory / "collect", directory / "light"
    light_s = install(python, str(wheel), reading, environment)
    collect_s = install(python, f"{wheel}[collect]", collecting, environment)
    engine = "bullet" if tuple(map(int, version.split("."))) <= LAST_WITH_BULLET else "mujoco"
    throwcollect, dataset = collecting / "bin" / "throwcollect", directory / "five throws"
    words: list[str | Path] = [
        throwcollect,
        "up",
        "-n",
        "1",
        "--runtime",
        "local",
        ROOT / "configs" / "quickstart.yaml",
    ]
    began = time.monotonic()
    settings = ["--set", "trials=5", "--set", f"sim.engine={engine}"]
    run([*words, *settings, "--output", dataset], directory, environment)
    throws_s = time.monotonic() - began
    digest = run([reading / "bin" / "python", "-c", READ, dataset], directory, environment).strip()
    return Tried(version, light_s, collect_s, engine, throws_s, digest)


def main() -> None:
    """Tries the versions that are asked for, or all."""
    rows = []
    with tempfile.TemporaryDirectory(prefix="try pythons ") as name:
        source = Path(name) / "source"
        source.mkdir()
        for file in ("pyproject.toml", "LICENSE"):
            shutil.copy(ROOT / file, source)
        shutil.copytree(ROOT / "src", source / "src", ignore=shutil.ignore_patterns("*.egg-info", "__pycache__"))
        pip: list[str | Path] = [
            sys.executable,
            "-m",
            "pip",
            "wheel",
            "--quiet",
            "--disable-pip-version-check",
            "--no-deps",
        ]
        run([*pip, "--wheel-dir", name, source], Path(name), os.environ)
        (wheel,) = Path(name).glob("*.whl")
        for version in sys.argv[1:] or VERSIONS:
            python = find_python(version)
            if python is None:
                rows.append(f"| {version} | not here | | | | |")
                continue
            directory = Path(name) / version
            rows.append(try_python(version, python, wheel, directory).row())
            print(rows[-1], flush=True)
            shutil.rmtree(directory)
    print("\n| Python | light core | with `collect` | engine | 5 throws | digest |\n|---|---|---|---|---|---|")
    print("\n".join(rows))


if __name__ == "__main__":
    main()
