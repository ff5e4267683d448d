"""Containers beside processes: throws a second, the time to the first throw, memory, and the image's size."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

from docker.client import DockerClient
from docker.errors import DockerException

from bench import collection
from throwcollect.collect.runtimes.docker.docker_engine import default_tag
from throwcollect.plan.plan import Plan

MANY = 8
_KINDS = {"processes": collection.local_runtime, "containers": collection.docker_runtime}


def image_mb() -> float | None:
    """Size of the default image [MB]; None without an engine or the image."""
    try:
        return float(DockerClient.from_env(timeout=5).images.get(default_tag()).attrs["Size"]) / 1e6
    except (DockerException, OSError):
        return None


def measure(plan: Plan, few: Plan, rounds: int, scratch: Path) -> dict[str, Any]:
    """Processes and containers in turns.

    Args:
        plan: Trials for the speed, with one simulation for each core.
        few: Some trials, for the time to the first throw of 1 and of `MANY` simulations.
        rounds: How often.
        scratch: Directory for datasets.

    Returns:
        For each number of simulations and each kind, a list with one measurement a round.
    """
    cores = len(os.sched_getaffinity(0))
    report: dict[str, Any] = {"image_mb": image_mb()}
    for simulations, trials in ((cores, plan), (1, few), (MANY, few)):
        found: dict[str, list[dict[str, Any]]] = {kind: [] for kind in _KINDS}
        for index in range(rounds):
            for kind, make in _KINDS.items():
                directory = scratch / f"{kind}-{simulations}-{len(trials.trials)}-{index}"
                measured = collection.measure(trials, simulations, directory, make)
                found[kind].append(
                    {
                        "throws_per_s": measured.throws_per_s,
                        "first_throw_s": measured.first_throw_s,
                        "memory_mb": measured.memory_mb,
                    }
                )
        report[f"n={simulations}"] = found
    return report
