"""`python -m bench`: the tables of docs/benchmarks.md, measured on this machine, and `build/bench.json`."""

from __future__ import annotations

import argparse
import itertools
import json
import os
import statistics
import tempfile
from collections.abc import Callable
from dataclasses import asdict
from functools import partial
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from bench import collection, containers, intake, raw, reading, soak
from bench.other_version import OtherVersion
from throwcollect.config.loader import load
from throwcollect.extras import ENGINE_PACKAGES

CONFIG = Path(__file__).parents[1] / "configs" / "quickstart.yaml"
RESULT = Path("build/bench.json")
_ENGINES = ("bullet", "mujoco")
_MANY = 8


def main() -> None:
    """Measure the raw loop and the collection in turns, as the machine's speed drifts, and print medians."""
    parser = argparse.ArgumentParser(prog="python -m bench", description=__doc__)
    parser.add_argument("--rounds", type=int, default=5, help="measurements of each kind [%(default)s]")
    parser.add_argument("--trials", type=int, default=400, help="throws of each collection [%(default)s]")
    parser.add_argument("--before", metavar="REVISION", help="a commit that is measured in turns with this version")
    arguments = parser.parse_args()
    cores = len(os.sched_getaffinity(0))
    overrides = {
        engine: [f"trials={arguments.trials}", f"sim.engine={engine}"]
        for engine in _ENGINES
        if find_spec(ENGINE_PACKAGES[engine].module) is not None
    }
    report: dict[str, Any] = {"cores": cores, **vars(arguments)}
    with tempfile.TemporaryDirectory(prefix="throwcollect-bench-") as scratch:
        before = OtherVersion(arguments.before, Path(scratch) / "before") if arguments.before else None
        for (engine, keys), simulations in itertools.product(overrides.items(), sorted({1, cores, _MANY})):
            plan = collection.draw_unchecked_plan(load(CONFIG, keys))
            rounds = []
            for index in range(arguments.rounds):
                place = Path(scratch) / f"{engine}-{simulations}-{index}"
                limit, _ = raw.measure(plan, min(simulations, cores), arguments.trials // 4)
                versions: list[tuple[str, Callable[[], collection.Collection]]] = [
                    ("now", partial(collection.measure, plan, simulations, place))
                ]
                if before is not None:
                    place = place.with_name(f"{place.name}-before")
                    versions.append(("before", partial(before.measure, CONFIG, keys, simulations, place)))
                # In turns, as whoever always comes second would find a machine that the first has warmed.
                found = {name: run() for name, run in versions[:: -1 if index % 2 else 1]}
                rounds.append({"raw_throws_per_s": limit} | {name: asdict(each) for name, each in found.items()})
            report[f"{engine}, n={simulations}"] = rounds
            _print_table(engine, simulations, rounds, loops=min(simulations, cores))
        if containers.image_mb() is None:
            print("\nno containers: no engine answers, or it does not have the image (make image)")
        else:
            few = collection.draw_unchecked_plan(load(CONFIG, [f"trials={10 * containers.MANY}"]))
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
    raw_rate = statistics.median(each["raw_throws_per_s"] for each in rounds)
    plural = "s" if simulations > 1 else ""
    print(f"\n## {engine}, {simulations} simulation{plural}, medians of {len(rounds)}\n")
    versions = [name for name in ("now", "before") if name in rounds[0]]
    print(f"| what | {' | '.join(versions)} |\n|---|{'---|' * len(versions)}")
    columns = [_describe([each[name] for each in rounds], rounds, loops / raw_rate * 1e3) for name in versions]
    print(f"| raw loop of the engine, {loops} at once | {' | '.join([f'{raw_rate:.1f} throws/s'] * len(versions))} |")
    for part in columns[0]:
        print(f"| {part} | {' | '.join(column[part] for column in columns)} |")
    if len(versions) > 1:
        faster = statistics.median(each["now"]["throws_per_s"] / each["before"]["throws_per_s"] for each in rounds)
        print(f"| throws/s now over before, of each round | {faster:.2f} | |")
    print(end="", flush=True)


def _describe(found: list[dict[str, Any]], rounds: list[dict[str, Any]], physics_ms: float) -> dict[str, str]:
    """What a version has cost, in words by part.

    Args:
        found: A `Collection` of each round.
        rounds: The rounds, with the raw loop of each.
        physics_ms: Time of a throw in the raw loop [ms].
    """

    def median(*keys: str) -> float:
        values: list[Any] = found
        for key in keys:
            values = [value[key] for value in values]
        return float(statistics.median(values))

    ratio = statistics.median(
        each["throws_per_s"] / one["raw_throws_per_s"] for each, one in zip(found, rounds, strict=True)
    )
    spent = {role: median("cpu_ms_per_throw", role) for role in collection.ROLES}
    parts = {
        "physics, as in the raw loop": physics_ms,
        "controllers, judging, encoding and ROS in the simulation": spent["sim"] - physics_ms,
        "router": spent["router"],
        "coordinator: checks, ROS": spent["coordinator"] - median("disk_ms_per_throw"),
        "coordinator: kernel, disk and network": median("disk_ms_per_throw"),
    }
    total = sum(parts.values())
    return {
        "`throwcollect up`": f"{median('throws_per_s'):.1f} throws/s",
        "ratio, of each round": f"{ratio:.2f}",
        **{part: f"{cost:.1f} ms a throw ({cost / total:.0%})" for part, cost in parts.items()},
        **{f"memory of a {role}": f"{median('memory_mb', role):.0f} MB" for role in collection.ROLES},
        "recordings": f"{median('bytes_per_throw') / 1e3:.0f} kB a throw",
        "start of the nodes to the first throw": f"{median('first_throw_s'):.1f} s",
    }


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
