"""`compose/collect.sh` without an engine."""

from __future__ import annotations

import os
import subprocess
from pathlib import Path

import pytest

SCRIPT = Path(__file__).parents[3] / "compose" / "collect.sh"
DOCKER = """\
#!/bin/sh
# Compose fails as it does when the coordinator does; the copy brings a file if there is one.
case "$1 $*" in
    "compose "*" up "*)
        echo "$THROWCOLLECT_HOST $DATASET" >"$TOLD"
        [ -z "$SIGNAL" ] || kill -s "$SIGNAL" $PPID
        exit 4 ;;
    "compose "*" down "*) echo "$@" >"$TOLD.removed" ;;
    "run "*"${FULL:-never} "*) exit 1 ;;
    "run "*) [ -z "$BEGUN" ] || [ -e "$TOLD.removed" ] || touch "$OUTPUT/config.yaml" ;;
esac
"""


@pytest.mark.parametrize(
    ("begun", "signal", "code"), [("", "", 4), ("yes", "", 4), ("yes", "INT", 130), ("yes", "TERM", 130)]
)
def test_what_was_collected_is_taken_out_and_what_never_began_leaves_no_directory(
    tmp_path: Path, begun: str, signal: str, code: int
) -> None:
    (tmp_path / "docker").write_text(DOCKER)
    (tmp_path / "docker").chmod(0o755)
    (tmp_path / "bad.yaml").write_text("nonsense: 1\n")
    output = tmp_path / "my data"
    variables = {"OUTPUT": str(output), "TOLD": str(tmp_path / "told"), "BEGUN": begun, "SIGNAL": signal}
    # Of an .env file or a machine on which other datasets are made.
    variables["DATASET"] = "mnist"
    environment = {**os.environ, **variables, "PATH": f"{tmp_path}:{os.environ['PATH']}"}
    done = subprocess.run(
        [SCRIPT, tmp_path / "bad.yaml", "2", output], env=environment, capture_output=True, text=True, check=False
    )
    assert done.returncode == code, done.stderr
    assert output.exists() == bool(begun)
    assert (tmp_path / "told").read_text().split() == [os.uname().nodename, "dataset"]
    assert (tmp_path / "told.removed").exists()


@pytest.mark.parametrize("full", [True, False])
def test_a_volume_is_removed_only_when_the_dataset_is_out_of_it(tmp_path: Path, full: bool) -> None:
    (tmp_path / "docker").write_text(DOCKER)
    (tmp_path / "docker").chmod(0o755)
    (tmp_path / "fine.yaml").write_text("trials: 1\n")
    output, told = tmp_path / "data", tmp_path / "told"
    variables = {"OUTPUT": str(output), "TOLD": str(told), "BEGUN": "yes", "SIGNAL": ""}
    environment = {
        **os.environ,
        **variables,
        "FULL": "--rm" if full else "",
        "PATH": f"{tmp_path}:{os.environ['PATH']}",
    }
    done = subprocess.run(
        [SCRIPT, tmp_path / "fine.yaml", "2", output], env=environment, capture_output=True, text=True, check=False
    )
    assert done.returncode == 4
    assert ("--volumes" in (tmp_path / "told.removed").read_text()) is not full
    assert ("cannot be copied to" in done.stderr) is full
    assert output.exists() is not full


def test_an_output_that_cannot_be_made_is_told_before_anything_starts(tmp_path: Path) -> None:
    (tmp_path / "docker").write_text(DOCKER)
    (tmp_path / "docker").chmod(0o755)
    (tmp_path / "fine.yaml").write_text("trials: 1\n")
    environment = {**os.environ, "TOLD": str(tmp_path / "told"), "PATH": f"{tmp_path}:{os.environ['PATH']}"}
    output = tmp_path / "fine.yaml" / "data"
    done = subprocess.run(
        [SCRIPT, tmp_path / "fine.yaml", "2", output], env=environment, capture_output=True, text=True, check=False
    )
    assert done.returncode != 0
    assert str(output.parent) in done.stderr
    assert not list(tmp_path.glob("told*"))


def test_a_file_that_is_not_there_is_named_before_anything_starts(tmp_path: Path) -> None:
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
