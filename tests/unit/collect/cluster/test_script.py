"""Slurm and the shell read from batch scripts what the configuration says."""

from __future__ import annotations

import shlex
import subprocess
from pathlib import Path
from typing import Any

import pytest

from throwcollect.collect.cluster.script import BatchScripts
from throwcollect.config.run import ClusterConfig
from throwcollect.config.schema import Config


def scripts(directory: Path, *, image: Path | None = None, **cluster: Any) -> BatchScripts:
    config = Config.model_validate({"name": "many", "cluster": cluster})
    return BatchScripts(config, directory, directory / "cluster" / "logs", ("throwcollect",), image)


def options(script: str) -> dict[str, str]:
    """The options of a script. sbatch reads them by the rules of a shell."""
    found = {}
    for line in script.splitlines():
        if line.startswith("#SBATCH "):
            (word,) = shlex.split(line.removeprefix("#SBATCH "))
            name, _, value = word.removeprefix("--").partition("=")
            found[name] = value
    return found


def run(script: str, directory: Path, **programs: str) -> subprocess.CompletedProcess[str]:
    """Run a script with other programs in place of its commands."""
    for name in ("srun", "scontrol", "module"):
        path = directory / "bin" / name
        path.parent.mkdir(exist_ok=True)
        path.write_text(f"#!/bin/bash\n{programs.get(name, 'true')}\n")
        path.chmod(0o755)
    job = {"SLURM_ARRAY_JOB_ID": "70", "SLURM_ARRAY_TASK_ID": "3", "SLURM_JOB_ID": "77"}
    environment = {"PATH": f"{directory / 'bin'}:/usr/bin:/bin", **job}
    environment |= {name: value for name, value in programs.items() if name.isupper()}
    path = directory / "script.sh"
    path.write_text(script)
    return subprocess.run(["bash", path], capture_output=True, text=True, check=False, env=environment)


@pytest.fixture(params=["data", "with blank", "50 %", 'it\'s "quoted"', "$HOME", "a#b"])
def directory(tmp_path: Path, request: pytest.FixtureRequest) -> Path:
    """A directory with a plan, under a name that a shell may stumble over."""
    path = tmp_path / str(request.param)
    path.mkdir()
    return path


def test_options_of_the_batch_script_follow_from_the_configuration(tmp_path: Path) -> None:
    script = scripts(
        tmp_path, partition="long", account="robots", qos="low", constraint="avx2", time="4:00:00", memory="8G",
        cores=4, at_once=20, requeue=0,
    ).collect(100, "0-99")  # fmt: skip
    found = options(script)
    assert found["array"] == "0-99%20"
    assert found["cpus-per-task"] == "4"
    assert {found[name] for name in ("partition", "account", "qos", "constraint")} == {"long", "robots", "low", "avx2"}
    assert (found["time"], found["mem"]) == ("4:00:00", "8G")
    assert "no-requeue" in found
    assert "-lt 0 ]" in script


def test_options_that_the_configuration_leaves_out_are_left_to_the_scheduler(tmp_path: Path) -> None:
    found = options(scripts(tmp_path).collect(8, "0-7"))
    assert not found.keys() & {"partition", "account", "qos", "constraint", "time", "mem"}
    assert found["array"] == "0-7"
    assert "requeue" in found


def test_logs_and_comment_name_the_directory_despite_special_characters(directory: Path) -> None:
    found = options(scripts(directory).collect(8, "0-7"))
    assert found["output"].replace("%%", "%").replace("%A_%a", "") == f"{directory}/cluster/logs/.log"
    assert found["comment"] == f"throwcollect:{directory}"


def test_an_array_task_collects_its_slice(directory: Path, tmp_path: Path) -> None:
    done = run(scripts(directory, cores=4).collect(8, "0-7"), tmp_path, srun='printf "%s\\n" "$@"')
    words = done.stdout.splitlines()
    assert done.returncode == 0, done.stderr
    assert words[:4] == ["--ntasks=1", "--cpus-per-task=4", "throwcollect", "up"]
    assert words[words.index("--slice") + 1] == "3/8"
    assert words[words.index("--output") + 1] == str(directory)
    assert words[words.index("-n") + 1] == "4"


def test_a_task_in_an_image_gets_its_directories_and_no_variables_of_the_host(tmp_path: Path) -> None:
    made = scripts(tmp_path, image=Path("/images/t.sif"), binds=["/data:/inside:ro", "/$NAME"])
    done = run(made.collect(8, "0-7"), tmp_path, srun='printf "%s\\n" "$@"', NAME="mine")
    words = done.stdout.splitlines()
    assert words[2:5] == ["apptainer", "--quiet", "exec"]
    assert "--cleanenv" in words
    binds = [word.removeprefix("--bind=") for word in words if word.startswith("--bind=")]
    assert binds == [str(tmp_path), "/data:/inside:ro", "/$NAME"]
    assert words[words.index("/images/t.sif") + 1] == "throwcollect"


def test_lines_and_modules_of_the_site_come_before_the_task(tmp_path: Path) -> None:
    made = scripts(tmp_path, lines=["#SBATCH --gres=tmp:10G", "export SITE=here"], modules=["apptainer/1.4"])
    script = made.collect(8, "0-7")
    assert options(script)["gres"] == "tmp:10G"
    done = run(script, tmp_path, module='echo "module $*"', srun='echo "SITE=$SITE"')
    assert done.stdout.splitlines() == ["module load apptainer/1.4", "SITE=here"]


@pytest.mark.parametrize(
    ("code", "restarts", "queued"), [(130, 0, True), (130, 10, False), (3, 0, False), (0, 0, False)]
)
def test_an_interrupted_task_is_queued_again_up_to_ten_times(
    tmp_path: Path, code: int, restarts: int, queued: bool
) -> None:
    done = run(
        scripts(tmp_path).collect(8, "0-7"),
        tmp_path,
        srun=f"exit {code}",
        scontrol='echo "$@"',
        SLURM_RESTART_COUNT=str(restarts),
    )
    assert done.stdout == ("requeue 70_3\n" if queued else "")
    assert done.returncode == code


def test_the_joining_job_calls_join_with_the_directory(directory: Path, tmp_path: Path) -> None:
    done = run(scripts(directory).join(), tmp_path, srun='printf "%s\\n" "$@"')
    assert done.stdout.splitlines()[2:] == ["throwcollect", "join", str(directory)]


@pytest.mark.parametrize(
    ("key", "value"),
    [
        ("time", "soon"),
        ("partition", "a b"),
        ("binds", ["relative:/inside"]),
    ],
)
def test_cluster_values_that_a_script_cannot_hold_are_refused(key: str, value: object) -> None:
    with pytest.raises(ValueError, match=key):
        ClusterConfig.model_validate({key: value})
