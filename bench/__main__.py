"""`python -m bench`: the tables of docs/benchmarks.md, measured on this machine, and `build/bench.json`."""

from __future__ import annotations

import argparse
import itertools
import json
import os
import statistics
import tempfile
from dataclasses import asdict
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from bench import collection, containers, intake, raw, reading, soak
from throwcollect.config.loader import load
from throwcollect.engine_packages import PACKAGES
from throwcollect.sweep.plan import make_plan

CONFIG = Path(__file__).parents[1] / "configs" / "quickstart.yaml"
RESULT = Path("build/bench.json")
_ENGINES = ("bullet", "mujoco")
_MANY = 8


def main() -> None:
    """Measure the raw loop and the collection in turns, as the machine's speed drifts, and print medians."""
    parser = argparse.ArgumentParser(prog="python -m bench", description=__doc__)
    parser.add_argument("--rounds", type=int, default=5, help="measurements of each kind [%(default)s]")
    parser.add_argument("--trials", type=int, default=400, help="throws of each collection [%(default)s]")
    arguments = parser.parse_args()
    cores = len(os.sched_getaffinity(0))
    plans = {
        engine: make_plan(load(CONFIG, [f"trials={arguments.trials}", f"sim.engine={engine}"]))
        for engine in _ENGINES
        if find_spec(PACKAGES[engine].module) is not None
    }
    report: dict[str, Any] = {"cores": cores, "trials": arguments.trials, "rounds": arguments.rounds}
    with tempfile.TemporaryDirectory(prefix="throwcollect-bench-") as scratch:
        for (engine, plan), simulations in itertools.product(plans.items(), sorted({1, cores, _MANY})):
            rounds = []
            for index in range(arguments.rounds):
                limit = raw.measure(plan, min(simulations, cores), arguments.trials // 4)
                found = collection.measure(plan, simulations, Path(scratch) / f"{engine}-{simulations}-{index}")
                rounds.append({"raw_throws_per_s": limit, "ratio": found.throws_per_s / limit, **asdict(found)})
            report[f"{engine}, n={simulations}"] = rounds
            _print_table(engine, simulations, rounds, loops=min(simulations, cores))
        if containers.image_mb() is None:
            print("\nno containers: no engine answers, or it does not have the image (throwcollect image build)")
        else:
            few = make_plan(load(CONFIG, [f"trials={10 * containers.MANY}"]))
            report["containers"] = containers.measure(plan, few, arguments.rounds, Path(scratch))
            _print_containers(report["containers"])
        looks = soak.measure()
        report["soak"] = [asdict(look) for look in looks]
        soak.show(looks)
        episodes = [intake.measure(Path(scratch) / "bullet-1-0") for _ in range(arguments.rounds)]
        read = reading.measure(Path(scratch) / "bullet-1-0", rounds=arguments.rounds)
        report["reading"] = asdict(read)
        reading.show(read)
    report["intake_episodes_per_s"] = [rate for rate, _ in episodes]
    report["intake_raw_episodes_per_s"] = [limit for _, limit in episodes]
    rate, share = (statistics.median(values) for values in zip(*((r, r / limit) for r, limit in episodes), strict=True))
    print(f"\ncoordinator takes in {rate:.0f} episodes/s (unpack, check, append; one thread)")
    print(f"{share:.2f} of what signatures and writing alone reach")
    RESULT.parent.mkdir(exist_ok=True)
    RESULT.write_text(json.dumps(report, indent=2) + "\n", encoding="utf-8")
    print(f"all numbers: {RESULT}")


def _print_table(engine: str, simulations: int, rounds: list[dict[str, Any]], *, loops: int) -> None:
    def median(*keys: str) -> float:
        values: list[Any] = rounds
        for key in keys:
            values = [value[key] for value in values]
        return float(statistics.median(values))

    plural = "s" if simulations > 1 else ""
    print(f"\n## {engine}, {simulations} simulation{plural}, medians of {len(rounds)}\n")
    print("| what | |\n|---|---|")
    print(f"| raw loop of the engine, {loops} at once | {median('raw_throws_per_s'):.1f} throws/s |")
    print(f"| `throwcollect up -n {simulations}` | {median('throws_per_s'):.1f} throws/s |")
    print(f"| ratio | {median('ratio'):.2f} |")
    spent = {role: median("cpu_ms_per_throw", role) for role in collection.ROLES}
    physics = loops * 1e3 / median("raw_throws_per_s")
    parts = {
        "physics, as in the raw loop": physics,
        "controllers, judging, encoding and ROS in the simulation": spent["sim"] - physics,
        "router": spent["router"],
        "coordinator: checks, ROS": spent["coordinator"] - median("disk_ms_per_throw"),
        "coordinator: kernel, disk and network": median("disk_ms_per_throw"),
    }
    for part, milliseconds in parts.items():
        print(f"| {part} | {milliseconds:.1f} ms a throw ({milliseconds / sum(parts.values()):.0%}) |")
    for role in collection.ROLES:
        print(f"| memory of a {role} | {median('memory_mb', role):.0f} MB |")
    print(f"| recordings | {median('bytes_per_throw') / 1e3:.0f} kB a throw |")
    print(f"| start of the nodes to the first throw | {median('first_throw_s'):.1f} s |", flush=True)


def _print_containers(report: dict[str, Any]) -> None:
    print("\n## Containers beside processes, medians\n")
    print("| what | processes | containers | containers over processes |\n|---|---|---|---|")

    def row(what: str, number: str, *keys: str) -> None:
        medians = []
        for kind in ("processes", "containers"):
            values = report[number][kind]
            for key in keys:
                values = [value[key] for value in values]
            medians.append(statistics.median(values))
        print(f"| {what} | {medians[0]:.1f} | {medians[1]:.1f} | {medians[1] / medians[0]:.2f} |")

    for number in (key for key in report if key.startswith("n=")):
        row(f"start to the first throw, {number} [s]", number, "first_throw_s")
        row(f"throws/s, {number}", number, "throws_per_s")
        for role in collection.ROLES:
            row(f"memory of a {role}, {number} [MB]", number, "memory_mb", role)
    print(f"\nimage: {report['image_mb']:.0f} MB", flush=True)


if __name__ == "__main__":
    main()
