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


def test_a_collection_that_never_began_leaves_no_directory_and_no_volume(tmp_path: Path, calls: Path) -> None:
    assert collect(tmp_path, "data", UP="2").returncode == 2
    assert not (tmp_path / "data").exists()
    assert calls.read_text().splitlines()[-1].endswith(" down --volumes --timeout 5")


def test_the_cdpath_of_the_user_does_not_change_directories(tmp_path: Path, calls: Path) -> None:
    assert collect(tmp_path, "data", CDPATH=".").returncode == 0
    up, run, _ = calls.read_text().splitlines()
    assert up == f"up {tmp_path}/configs throws.yaml"
    assert f" -v {tmp_path}/data:/out " in run


def test_an_unavailable_image_is_named_before_anything_is_created(tmp_path: Path, calls: Path) -> None:
    done = collect(tmp_path, "data", INSPECT="1", THROWCOLLECT_IMAGE="nobody/has:1")
    assert (done.returncode, calls.read_text()) == (2, "")
    assert "pull nobody/has:1: access denied" in done.stderr
    assert "nobody/has:1: cannot be had; `throwcollect image build` makes it" in done.stderr
    assert not (tmp_path / "data").exists()


def test_a_machine_without_compose_is_an_error(tmp_path: Path, calls: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    commands = calls.parent / "bin"
    for name in ("sh", "dirname", "basename", "id", "uname", "mkdir", "rmdir"):
        (commands / name).symlink_to(shutil.which(name) or name)
    (commands / "docker").unlink()
    done = collect(tmp_path, "data", PATH=str(commands))
    assert (done.returncode, done.stderr) == (2, f"{SCRIPT}: neither `docker compose` nor docker-compose is here\n")
    assert not (tmp_path / "data").exists()


@pytest.mark.parametrize("place", ["configs", "output"])
def test_a_colon_in_a_path_is_refused_before_anything_is_collected(tmp_path: Path, calls: Path, place: str) -> None:
    (tmp_path / "a:b").mkdir()
    (tmp_path / "a:b" / "throws.yaml").touch()
    paths = {"configs": {"config": "a:b/throws.yaml", "output": "data"}, "output": {"output": "a:b/data"}}[place]
    done = collect(tmp_path, **paths)
    assert (done.returncode, calls.read_text()) == (2, "")
    assert "should have no colon" in done.stderr
    assert not (tmp_path / paths["output"]).exists()


def test_names_of_files_may_begin_with_a_dash(tmp_path: Path, calls: Path) -> None:
    (tmp_path / "-v.yaml").touch()
    assert collect(tmp_path, "-data", config="-v.yaml").returncode == 0
    assert calls.read_text().splitlines()[0] == f"up {tmp_path} -v.yaml"


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


def test_a_missing_configuration_is_named_before_anything_starts(tmp_path: Path) -> None:
    (tmp_path / "docker").write_text('#!/bin/sh\necho "$@" >>"$TOLD"\n')
    (tmp_path / "docker").chmod(0o755)
    told = tmp_path / "told"
    environment = {**os.environ, "TOLD": str(told), "PATH": f"{tmp_path}:{os.environ['PATH']}"}
    missing = tmp_path / "missing.yaml"
    done = subprocess.run(
        [SCRIPT, missing, "2", tmp_path / "data"], env=environment, capture_output=True, text=True, check=False
    )
    assert (done.returncode, done.stderr) == (2, f"{SCRIPT}: {missing}: no such file\n")
    assert not told.exists()
