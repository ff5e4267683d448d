"""What `compose/collect.sh` does where something fails, with an engine that only writes down what it is asked."""

import os
import shutil
import subprocess
from pathlib import Path

import pytest

SCRIPT = Path(__file__).parents[2] / "compose" / "collect.sh"


@pytest.fixture
def calls(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """File with a line for each call of the engine; `RUN` is the exit code of containers, `UP` that of Compose."""
    path = tmp_path / "calls"
    path.touch()
    docker = tmp_path / "bin" / "docker"
    docker.parent.mkdir()
    docker.write_text(
        f"""#!/bin/sh
case "$*" in
    *" up "*) echo "up $CONFIGS $CONFIG" >> {path}; exit "${{UP:-0}}" ;;
    run*) echo "run $*" >> {path}; exit "${{RUN:-0}}" ;;
    *" down "*) echo "$*" >> {path} ;;
esac
"""
    )
    docker.chmod(0o755)
    (tmp_path / "configs").mkdir()
    (tmp_path / "configs" / "throws.yaml").touch()
    monkeypatch.setenv("PATH", f"{docker.parent}:{os.environ['PATH']}")
    return path


def collect(directory: Path, output: str, **variables: str) -> subprocess.CompletedProcess[str]:
    words = [shutil.which("dash") or "sh", str(SCRIPT), "configs/throws.yaml", "2", output]
    environment = {**os.environ, **variables}
    return subprocess.run(words, cwd=directory, env=environment, capture_output=True, text=True, check=False)


def test_nothing_is_collected_that_could_not_be_put_anywhere(tmp_path: Path, calls: Path) -> None:
    (tmp_path / "file").touch()
    assert collect(tmp_path, "file/data").returncode == 2
    assert calls.read_text() == ""


def test_a_dataset_that_cannot_be_copied_stays_in_its_volume(tmp_path: Path, calls: Path) -> None:
    done = collect(tmp_path, "data", RUN="1")
    assert done.returncode == 1
    assert "it stays in the volume throwcollect-" in done.stderr
    (down,) = [line for line in calls.read_text().splitlines() if " down " in line]
    assert "--volumes" not in down
    assert collect(tmp_path, "other", RUN="1", UP="5").returncode == 5


def test_of_a_collection_that_never_began_nothing_stays(tmp_path: Path, calls: Path) -> None:
    assert collect(tmp_path, "data", UP="2").returncode == 2
    assert not (tmp_path / "data").exists()
    assert calls.read_text().splitlines()[-1].endswith(" down --volumes --timeout 5")


def test_directories_are_found_whatever_the_shell_of_the_user_searches(tmp_path: Path, calls: Path) -> None:
    assert collect(tmp_path, "data", CDPATH=".").returncode == 0
    up, run, _ = calls.read_text().splitlines()
    assert up == f"up {tmp_path}/configs throws.yaml"
    assert f" -v {tmp_path}/data:/out " in run
