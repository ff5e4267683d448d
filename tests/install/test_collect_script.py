"""Failures of `compose/collect.sh`, with a stand-in for the engine that only records how it is called."""

import os
import shutil
import subprocess
from pathlib import Path

import pytest

SCRIPT = Path(__file__).parents[2] / "compose" / "collect.sh"
DOCKER = """\
#!/bin/sh
# Compose fails as it does when the coordinator does; the copy brings a file if there is one.
case "$1 $*" in
    "compose "*" up "*)
        echo "$THROWCOLLECT_HOST $DATASET" >"$TOLD"
        [ -z "$SIGNAL" ] || kill -s "$SIGNAL" $PPID
        exit 4 ;;
    "compose "*" down "*) touch "$TOLD.removed" ;;
    "run "*) [ -z "$BEGUN" ] || [ -e "$TOLD.removed" ] || touch "$OUTPUT/config.yaml" ;;
esac
"""


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
    "image inspect "*) exit "${{INSPECT:-0}}" ;;
    "pull "*) echo "pull $2: access denied" >&2; exit 1 ;;
esac
"""
    )
    docker.chmod(0o755)
    (tmp_path / "configs").mkdir()
    (tmp_path / "configs" / "throws.yaml").touch()
    monkeypatch.setenv("PATH", f"{docker.parent}:{os.environ['PATH']}")
    return path


def collect(
    directory: Path, output: str, *, config: str = "configs/throws.yaml", **variables: str
) -> subprocess.CompletedProcess[str]:
    words = [shutil.which("dash") or "sh", str(SCRIPT), config, "2", output]
    environment = {**os.environ, **variables}
    return subprocess.run(words, cwd=directory, env=environment, capture_output=True, text=True, check=False)


def test_an_impossible_output_directory_is_refused_before_the_engine_is_called(tmp_path: Path, calls: Path) -> None:
    (tmp_path / "file").touch()
    assert collect(tmp_path, "file/data").returncode == 2
    assert calls.read_text() == ""


def test_a_dataset_that_cannot_be_copied_stays_in_its_volume(tmp_path: Path, calls: Path) -> None:
    done = collect(tmp_path, "data", RUN="1")
    assert done.returncode == 1
    assert "stays in the volume throwcollect-" in done.stderr
    (down,) = [line for line in calls.read_text().splitlines() if " down " in line]
    assert "--volumes" not in down
    assert collect(tmp_path, "other", RUN="1", UP="5").returncode == 5


@pytest.mark.parametrize(
    ("begun", "signal", "code"), [("", "", 4), ("yes", "", 4), ("yes", "INT", 130), ("yes", "TERM", 130)]
)
def test_only_a_collection_that_began_leaves_an_output_directory(
    tmp_path: Path, begun: str, signal: str, code: int
) -> None:
    (tmp_path / "docker").write_text(DOCKER)
    (tmp_path / "docker").chmod(0o755)
    (tmp_path / "bad.yaml").write_text("nonsense: 1\n")
    output = tmp_path / "my data"
    variables = {"OUTPUT": str(output), "TOLD": str(tmp_path / "told"), "BEGUN": begun, "SIGNAL": signal}
    # A variable of this name may come from an .env file, or from other datasets on the machine.
    variables["DATASET"] = "mnist"
    environment = {**os.environ, **variables, "PATH": f"{tmp_path}:{os.environ['PATH']}"}
    done = subprocess.run(
        [SCRIPT, tmp_path / "bad.yaml", "2", output], env=environment, capture_output=True, text=True, check=False
    )
    assert done.returncode == code, done.stderr
    assert output.exists() == bool(begun)
    assert (tmp_path / "told").read_text().split() == [os.uname().nodename, "dataset"]
    assert (tmp_path / "told.removed").exists()
