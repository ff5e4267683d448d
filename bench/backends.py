"""`python -m bench.backends`: both backends of ROS 2 in turns; for the environment that `make ros` makes."""

from __future__ import annotations

import argparse
import json
import os
import statistics
import subprocess
import sys
import tempfile
from dataclasses import asdict
from pathlib import Path
from typing import Any

from bench import collection
from throwcollect.config.loader import load
from throwcollect.ros.middleware import VARIABLE

CONFIG = Path(__file__).parents[1] / "configs" / "quickstart.yaml"
BACKENDS = ("embedded", "rclpy")
SIMULATIONS = (1, 2, 8)


def main() -> None:
    """Print medians for each backend, or, as its own child, measure one collection on the backend of this process."""
    parser = argparse.ArgumentParser(prog="python -m bench.backends", description=__doc__)
    parser.add_argument("--rounds", type=int, default=3, help="measurements of each kind [%(default)s]")
    parser.add_argument("--trials", type=int, default=200, help="throws of each collection [%(default)s]")
    parser.add_argument("--one", type=int, metavar="N", help="measure one collection with N simulations")
    arguments = parser.parse_args()
    if arguments.one is not None:
        plan = collection.draw_unchecked_plan(load(CONFIG, [f"trials={arguments.trials}"]))
        with tempfile.TemporaryDirectory(prefix="throwcollect-bench-") as scratch:
            print(json.dumps(asdict(collection.measure(plan, arguments.one, Path(scratch) / "data"))))
        return
    for simulations in SIMULATIONS:
        rounds = [
            {backend: _measure(backend, simulations, arguments.trials) for backend in BACKENDS}
            for _ in range(arguments.rounds)
        ]
        _print_table(simulations, rounds)


def _measure(backend: str, simulations: int, trials: int) -> dict[str, Any]:
    # A process has one backend for all its life.
    said = subprocess.run(
        [sys.executable, "-m", "bench.backends", "--one", str(simulations), "--trials", str(trials)],
        env={**os.environ, VARIABLE: backend},
        stdout=subprocess.PIPE,
        check=True,
    ).stdout
    measured: dict[str, Any] = json.loads(said.splitlines()[-1])
    return measured


def _print_table(simulations: int, rounds: list[dict[str, dict[str, Any]]]) -> None:
    def medians(*keys: str) -> list[float]:
        found = []
        for backend in BACKENDS:
            values: list[Any] = [each[backend] for each in rounds]
            for key in keys:
                values = [value[key] for value in values]
            found.append(statistics.median(values))
        return found

    plural = "s" if simulations > 1 else ""
    print(f"\n## {simulations} simulation{plural}, medians of {len(rounds)}\n")
    print(f"| what | {' | '.join(BACKENDS)} |\n|---|---|---|")
    ratios = [each["rclpy"]["throws_per_s"] / each["embedded"]["throws_per_s"] for each in rounds]
    _print_row("throws/s", medians("throws_per_s"))
    print(f"| ratio of each round | | {', '.join(f'{ratio:.2f}' for ratio in ratios)} |")
    for role in collection.ROLES:
        _print_row(f"{role}: processor time a throw [ms]", medians("cpu_ms_per_throw", role))
    for role in collection.ROLES:
        _print_row(f"{role}: memory [MB]", medians("memory_mb", role))
    _print_row("start of the nodes to the first throw [s]", medians("first_throw_s"))


def _print_row(what: str, values: list[float]) -> None:
    print(f"| {what} | {' | '.join(f'{value:.1f}' for value in values)} |", flush=True)


if __name__ == "__main__":
    main()
