"""What `pip install throwcollect` without extras can do, in a fresh environment.

One Python is tried in each run, if possible another one than that of the tests; others are tried with
`THROWCOLLECT_TRY_PYTHONS=3.10,3.12,3.13`.

A few commands start as users start them. The others are forked off a process of that environment which has imported
what most of them import, because importing takes most of the time of a command.
"""

import filecmp
import json
import os
import shutil
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.unit.dataset.conftest import Collection
from throwcollect import compute_statistics, filter_dataset

ROOT = Path(__file__).parents[2]
KNOWN = ("3.13", "3.12", "3.10")
OWN = f"{sys.version_info.major}.{sys.version_info.minor}"
OF_THE_MOMENT = ("README.md", "datapackage.json", "provenance.json")
"""Files that say when and where a dataset was made."""
QUICKSTART = str(ROOT / "configs" / "quickstart.yaml")


def find_python(version: str) -> str | None:
    """Path of a Python of this version, in the path or beside the one that runs the tests, as pyenv and uv lay them."""
    beside = sorted(Path(sys.base_prefix).parent.glob(f"*{version}.*/bin/python"))
    for python in (shutil.which(f"python{version}"), *map(str, beside)):
        if python and subprocess.run([python, "-c", "import venv"], capture_output=True, check=False).returncode == 0:
            return python
    return None


def choose_versions() -> tuple[str, ...]:
    if asked := os.environ.get("THROWCOLLECT_TRY_PYTHONS"):
        return tuple(asked.split(","))
    return (next(filter(find_python, KNOWN), OWN),)


@pytest.fixture(scope="module", params=choose_versions())
def environment(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A fresh environment with the wheel of these sources and nothing but what it depends on."""
    python = sys.executable if request.param == OWN else find_python(request.param)
    assert python, f"no Python {request.param} is here"
    directory = tmp_path_factory.mktemp("light")
    source = directory / "source"
    source.mkdir()
    for name in ("pyproject.toml", "LICENSE"):
        shutil.copy(ROOT / name, source)
    shutil.copytree(ROOT / "src", source / "src", ignore=shutil.ignore_patterns("*.egg-info", "__pycache__"))
    uv = [sys.executable, "-m", "uv", "--quiet"]
    subprocess.run([*uv, "build", "--wheel", "--out-dir", directory, source], check=True)
    (wheel,) = directory.glob("*.whl")
    subprocess.run([*uv, "venv", "--python", python, directory / "venv"], check=True)
    into = ["--python", directory / "venv" / "bin" / "python"]
    subprocess.run([*uv, "pip", "install", *into, "--only-binary", ":all:", wheel], check=True)
    return directory / "venv" / "bin"


@pytest.fixture(scope="module")
def dataset(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return Collection({"trials": 6}).collect(tmp_path_factory.mktemp("data") / "dataset")


def clean_variables() -> dict[str, str]:
    """Variables by which Python finds nothing but what is installed."""
    return {name: value for name, value in os.environ.items() if name != "PYTHONPATH"}


def run(environment: Path, program: str, *arguments: object) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [environment / program, *map(str, arguments)],
        capture_output=True,
        text=True,
        env=clean_variables(),
        timeout=300,
        check=False,
    )


class Forker:
    """A process of an environment that imports what commands import, and forks them.

    What an extra brings is imported by commands alone, so that it is missing there as it is in one that is started.
    """

    PROGRAM = """
import json, os, sys, warnings
import throwcollect.cli.main, throwcollect.collect.coordinator.prepare, throwcollect.dataset.reader, pyarrow.parquet
from throwcollect.__main__ import main

warnings.filterwarnings("ignore", "This process .* is multi-threaded", DeprecationWarning)
for line in sys.stdin:
    if (command := os.fork()) == 0:
        sys.argv[1:], streams = json.loads(line)
        for number, name in enumerate(streams):
            os.dup2(os.open(name, os.O_RDWR | os.O_CREAT | os.O_TRUNC, 0o600), number)
        main()
        break
    print(os.waitstatus_to_exitcode(os.waitpid(command, 0)[1]), flush=True)
"""

    def __init__(self, environment: Path, directory: Path) -> None:
        # Python looks first in the directory of a program, so this one has nothing else in it.
        program = directory / "throwcollect"
        program.write_text(self.PROGRAM)
        self._streams = [directory.with_name(f"{directory.name}-{name}") for name in ("stdout", "stderr")]
        self._process = subprocess.Popen(
            [environment / "python", program],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
            env=clean_variables(),
        )

    def run(self, *arguments: object) -> subprocess.CompletedProcess[str]:
        """Run a command to its end."""
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        streams = [os.devnull, *map(str, self._streams)]
        self._process.stdin.write(json.dumps([[*map(str, arguments)], streams]) + "\n")
        self._process.stdin.flush()
        code = int(self._process.stdout.readline())
        return subprocess.CompletedProcess(arguments, code, *(path.read_text() for path in self._streams))

    def close(self) -> None:
        """Let the process end."""
        self._process.communicate()


@pytest.fixture(scope="module")
def forker(environment: Path, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Forker]:
    forker = Forker(environment, tmp_path_factory.mktemp("forker"))
    yield forker
    forker.close()


def test_no_package_of_the_extras_is_installed(environment: Path) -> None:
    script = "from throwcollect.extras import EXTRA_OF, is_installed; print([*filter(is_installed, EXTRA_OF)])"
    assert run(environment, "python", "-c", script).stdout == "[]\n"


def test_datasets_are_read_exported_and_derived_as_with_all_extras(
    environment: Path, forker: Forker, dataset: Path, tmp_path: Path
) -> None:
    first, second = tmp_path / "first", tmp_path / "second"
    filter_dataset(dataset, first, where="trial < 3")
    filter_dataset(dataset, second, where="trial >= 3")
    for arguments in (
        ("dataset", "info", dataset),
        ("dataset", "export", dataset, tmp_path / "parquet", "--to", "parquet"),
        ("dataset", "export", dataset, tmp_path / "lerobot", "--to", "lerobot"),
        ("dataset", "export", dataset, tmp_path / "npz", "--to", "npz", "--rate", "50"),
        ("dataset", "merge", first, second, tmp_path / "merged"),
        ("config", QUICKSTART),
    ):
        said = forker.run(*arguments)
        # On a slow machine, work tells how far it has come.
        told = [line for line in said.stderr.splitlines() if " trials " not in line]
        assert (said.returncode, told) == (0, []), arguments
        assert said.stdout, arguments
    stats = forker.run("dataset", "stats", dataset, "--json").stdout
    assert json.loads(stats)["samples"] == compute_statistics(dataset).samples
    said = run(environment, "throwcollect", "dataset", "filter", dataset, tmp_path / "few", "--where", "trial < 3")
    assert said.returncode == 0, said.stderr
    names = sorted(path.name for path in first.iterdir() if path.name not in OF_THE_MOMENT)
    assert filecmp.cmpfiles(tmp_path / "few", first, names, shallow=False) == (names, [], [])


def test_verify_names_the_checks_that_need_an_extra(environment: Path, dataset: Path) -> None:
    said = run(environment, "throwcollect", "dataset", "verify", dataset)
    assert (said.returncode, said.stderr) == (0, "")
    assert "nothing wrong" in said.stdout
    assert "not checked without the extra collect: what came of the throws" in said.stdout
    recording = min(dataset.glob("*.mcap"))
    damaged = bytearray(recording.read_bytes())
    damaged[len(damaged) // 2] ^= 1
    whole = recording.read_bytes()
    recording.write_bytes(damaged)
    assert run(environment, "throwcollect", "dataset", "verify", dataset).returncode == 4
    recording.write_bytes(whole)


def test_the_public_functions_read_in_python(environment: Path, dataset: Path) -> None:
    script = """
import sys
import throwcollect

dataset = throwcollect.load(sys.argv[1])
print(len(dataset), dataset[2].ball.position.shape[1], throwcollect.load_config(sys.argv[2]).name)
print(throwcollect.verify_dataset(sys.argv[1]))
try:
    throwcollect.Simulator
except ImportError as error:
    print(type(error).__name__, error.extra)
try:
    throwcollect.runs.find("first")
except throwcollect.MissingExtraError as error:
    print(type(error).__name__, error.extra)
"""
    said = run(environment, "python", "-c", script, dataset, QUICKSTART)
    assert said.stdout.splitlines() == ["6 3 quickstart", "[]", *["MissingExtraError collect"] * 2], said.stderr


@pytest.mark.parametrize(
    ("extra", "arguments"),
    [
        ("collect", ("plan", QUICKSTART)),
        ("collect", ("ros", "topic", "list")),
        ("report", ("dataset", "report", "DATASET")),
        ("export", ("dataset", "export", "DATASET", "out", "--to", "mat")),
    ],
)
def test_a_command_without_its_extra_names_that_extra(
    extra: str, arguments: tuple[str, ...], forker: Forker, dataset: Path, tmp_path: Path
) -> None:
    names = {"DATASET": str(dataset), "out": str(tmp_path / "out")}
    said = forker.run(*(names.get(word, word) for word in arguments))
    assert (said.returncode, said.stdout) == (2, "")
    first, *rest = said.stderr.splitlines()
    assert first.startswith("throwcollect: this needs ")
    assert rest == [f"  try: pip install 'throwcollect[{extra}]'"]
    assert not (tmp_path / "out").exists()
