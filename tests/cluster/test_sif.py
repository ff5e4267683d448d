"""The image as Apptainer runs it: as any user, on a root that cannot be written, beside others on the same machine."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from docker.client import DockerClient

from tests.cluster.conftest import SHARED, USER
from tests.e2e.collection import CONFIG, FAST, fingerprints, write_config
from tests.pages import read_section
from throwcollect import runs
from throwcollect.collect.cluster.submit import check_sif
from throwcollect.state_directory import STATE_VARIABLE

pytestmark = pytest.mark.cluster
ROOT = Path(__file__).parents[2]
BASE = "throwcollect-base:bookworm-build"
PAGE = read_section("running.md", "Apptainer and Singularity")
COMMANDS = re.findall(r"^ *(apptainer .*?throwcollect\.sif up [^#\n]*)", PAGE, flags=re.MULTILINE)
PLACES = ("/tmp", "/var/tmp", "/home", "/dev/shm", "/run", "/run/user", "/opt")
"""Directories that all users of a machine share."""
AUTOMATIC = CONFIG.replace("runtime: local, ", "")


@pytest.fixture(scope="module")
def expected(tmp_path_factory: pytest.TempPathFactory) -> dict[str, str]:
    """The files that processes of this machine make."""
    directory = tmp_path_factory.mktemp("expected")
    config = write_config(directory, trials=6, text=AUTOMATIC, sim=FAST)
    with runs.prepare(config, overrides=["run.runtime=inprocess"], output=directory / "dataset") as run:
        run.collect()
    return fingerprints(directory / "dataset")


@pytest.fixture
def place(shared: Path, sif: Path) -> Path:
    """A directory of the user with a configuration, the image, and one for temporary files."""
    write_config(shared, trials=6, text=AUTOMATIC, sim=FAST).rename(shared / "throws.yaml")
    (shared / "throwcollect.sif").symlink_to(sif)
    (shared / "tmp").mkdir()
    shutil.chown(shared / "tmp", USER, USER)
    return shared


def start(command: str, directory: Path, user: str = USER, **environment: str) -> subprocess.Popen[str]:
    """A shell command of a user who has no home; the directory in which this process remembers runs is not theirs."""
    return subprocess.Popen(
        ["runuser", "-u", user, "--", "env", "-u", "HOME", "-u", STATE_VARIABLE, "sh", "-c", command],
        cwd=directory,
        env={**os.environ, **environment},
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
    )


def finish(process: subprocess.Popen[str], *, seconds: float = 120) -> str:
    printed, _ = process.communicate(timeout=seconds)
    assert process.returncode == 0, printed
    return printed


def files_of(user: str) -> set[str]:
    """All files of a user in directories that users share, apart from the directories of running tests."""
    own = ("-user", user)
    # The user cannot write into closed directories of others, and to walk through them may take half a minute.
    closed = ("-type", "d", "-not", *own, "-not", "-perm", "-o=w", "-prune")
    tests = ("-name", f"{SHARED}*", "-prune", "-o", *closed, "-o", *own, "-not", "-type", "d", "-print")
    words = ("find", *(place for place in PLACES if Path(place).exists()), "-mindepth", "1", *tests)
    # `find` complains of files that other processes remove meanwhile.
    return set(subprocess.run(words, capture_output=True, text=True, check=False).stdout.splitlines())


@pytest.mark.parametrize("command", COMMANDS)
def test_the_documented_commands_make_the_usual_files_and_write_nowhere_else(
    command: str, place: Path, expected: dict[str, str]
) -> None:
    before = files_of(USER)
    printed = finish(start(command, place, TMPDIR=str(place / "tmp"), PYTHONPATH="/nowhere", PYTHONHOME="/nowhere"))
    assert "runtime: local processes (auto, as the package docker is not installed)" in printed
    assert fingerprints(place / "dataset") == expected
    assert files_of(USER) <= before


def test_the_docs_run_the_image_with_and_without_containall() -> None:
    assert [("--containall" in command) for command in COMMANDS] == [False, True]


def test_two_users_on_one_machine_do_not_disturb_each_other(place: Path, expected: dict[str, str]) -> None:
    place.chmod(0o755)
    processes = []
    for user in (USER, "nobody"):
        (place / user).mkdir()
        shutil.chown(place / user, user)
        command = f"apptainer run throwcollect.sif up -n 1 throws.yaml --output {user}/dataset"
        processes.append(start(command, place, user))
    for process in processes:
        finish(process)
    assert fingerprints(place / USER / "dataset") == fingerprints(place / "nobody" / "dataset") == expected


@pytest.mark.skipif(
    "THROWCOLLECT_TEST_ALL" not in os.environ, reason="takes a minute of two cores; THROWCOLLECT_TEST_ALL=1"
)
def test_a_sif_built_without_an_engine_collects_the_same_files(
    client: DockerClient, place: Path, expected: dict[str, str]
) -> None:
    if not (ROOT / "docker" / "wheelhouse").exists() or not client.images.list(BASE):
        pytest.skip(f"there is no docker/wheelhouse, or no image {BASE}; .ci/engine.sh makes both")
    # The user of the jobs needs a clone of their own, as they cannot read this one everywhere.
    clone = place / "clone"
    for name in ("configs", "docker", "src"):
        shutil.copytree(ROOT / name, clone / name, ignore=shutil.ignore_patterns("__pycache__", "*.egg-info"))
    shutil.copy(ROOT / "pyproject.toml", clone)
    subprocess.run(["docker", "save", BASE, "-o", place / "base.tar"], check=True)
    (place / "base.tar").chmod(0o644)
    labels = subprocess.check_output([sys.executable, ROOT / "docker" / "build_arguments.py"], text=True).strip()
    base = f"--build-arg BOOTSTRAP=docker-archive --build-arg BASE_IMAGE={place}/base.tar"
    command = f"apptainer build {labels} {base} {place}/own.sif docker/throwcollect.def"
    work = {f"APPTAINER_{name}": str(place / "tmp") for name in ("TMPDIR", "CACHEDIR", "CONFIGDIR")}
    finish(start(command, clone, **work), seconds=600)
    check_sif(place / "own.sif")
    finish(start("apptainer run own.sif up -n 2 throws.yaml --output dataset", place, PYTHONPATH="/nowhere"))
    assert fingerprints(place / "dataset") == expected
