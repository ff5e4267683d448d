"""The Slurm of the tests can lose nodes and get them back, as the Slurm of a real cluster does."""

import os
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from tests.cluster.conftest import USER
from tests.cluster.slurm import Slurm

pytestmark = pytest.mark.cluster


@pytest.fixture
def job(slurm: Slurm, shared: Path) -> Iterator[tuple[str, int]]:
    """Node and process of a job that sleeps; the node is free again afterwards."""
    script = shared / "job.sh"
    script.write_text(f"#!/bin/sh\nsrun sh -c 'echo $SLURMD_NODENAME $$ > {shared}/on; exec env -i sleep 1000'\n")
    number = slurm.run("sbatch", "--parsable", "--output=/dev/null", str(script), user=USER, cwd=shared).strip()
    until(lambda: (shared / "on").exists() and (shared / "on").read_text().endswith("\n"))
    node, process = (shared / "on").read_text().split()
    yield node, int(process)
    slurm.run("scancel", number)
    until(lambda: slurm.state(node) == "idle")


def test_a_node_that_dies_takes_its_processes_along(slurm: Slurm, job: tuple[str, int]) -> None:
    node, process = job
    slurm.kill_node(node)
    assert not lives(process)
    slurm.revive(node)


def test_a_job_survives_the_death_of_slurmd(slurm: Slurm, job: tuple[str, int]) -> None:
    node, process = job
    slurm.kill_slurmd(node)
    assert lives(process)
    slurm.revive(node)
    assert lives(process)


def lives(process: int) -> bool:
    try:
        return os.readlink(f"/proc/{process}/exe") != ""
    except OSError:
        # A process that has ended has no program any more, though it may be listed.
        return False


def until(condition: Callable[[], bool]) -> None:
    deadline = time.monotonic() + 30
    while not condition():
        assert time.monotonic() < deadline
        time.sleep(0.1)
