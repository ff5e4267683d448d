"""How the output of Slurm's commands is read."""

from __future__ import annotations

from pathlib import Path

import pytest

from throwcollect.collect.cluster import slurm
from throwcollect.errors import ConfigError

QUEUE = """\
7|0|SIGNALING|a1|None
7|1|OUT_OF_MEMORY|a1|OutOfMemory
7|2|PENDING||BeginTime
7|3|NEW_IN_ANOTHER_VERSION|a2|None
7|4|FAILED|a3|JobLaunchFailure
8|N/A|PENDING||Dependency
"""


def test_a_task_that_slurm_warns_of_its_time_limit_counts_as_running(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """If the task counted as ended, its slice would be submitted once more."""
    (tmp_path / "squeue").write_text(f"#!/bin/sh\ncat <<END\n{QUEUE}END\n")
    (tmp_path / "squeue").chmod(0o755)
    monkeypatch.setenv("PATH", f"{tmp_path}:/usr/bin:/bin")
    found = slurm.find_tasks()
    assert [(task.index, task.lives, task.runs, task.saw_no_directory) for task in found["7"]] == [
        (0, True, True, False),
        (1, False, False, False),
        (2, True, False, False),
        (3, True, False, False),
        (4, False, False, True),
    ]
    (joining,) = found["8"]
    assert (joining.index, joining.reason) == (None, "Dependency")


def test_a_refusal_by_slurm_names_the_file_and_option_that_correct_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "sbatch").write_text("#!/bin/sh\necho 'invalid partition specified: standard' >&2\nexit 1\n")
    (tmp_path / "sbatch").chmod(0o755)
    monkeypatch.setenv("PATH", f"{tmp_path}:/usr/bin:/bin")
    monkeypatch.setenv("XDG_CONFIG_HOME", "/home/me/.config")
    with pytest.raises(ConfigError, match="invalid partition specified: standard") as refused:
        slurm.submit(tmp_path / "script")
    assert "/home/me/.config/throwcollect/cluster.yaml" in str(refused.value)
    assert "--set cluster." in str(refused.value)
