"""`python -m bench.peers`: throws/s of throwcollect and of packages that users pick instead, and `build/peers.json`."""

from __future__ import annotations

import argparse
import json
import os
import statistics
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import NamedTuple

import numpy as np

from bench import collection, raw
from throwcollect import Simulator
from throwcollect.config.loader import load
from throwcollect.plan.plan import Plan

CONFIG = Path(__file__).parents[2] / "configs" / "panda.yaml"
BUILD = Path("build/peers")
RESULT = Path("build/peers.json")
_PACKAGES = {"mujoco": "mujoco", "bullet": "pybullet"}
"""The package that somebody writes a loop with, by engine."""
_QUARTER_TURN = np.pi / 2
_MOST_ERROR_RAD, _LEAST_FLIGHT_M = 0.05, 0.3
"""What is no throw: joints farther from their commands, and balls that come less far, in the median."""
_DISTINCT = 32
"""Trials whose commands the peers get; they simulate them again and again."""


class Peer(NamedTuple):
    """A script of this directory, `with_NAME.py`, and its packages, `NAME.txt`.

    Attributes:
        title: What it is, in the table.
        share: Throws of a round over those of throwcollect, so that slow peers do not take hours.
    """

    title: str
    share: float


PEERS = {
    "rollout": Peer("`mujoco.rollout`, threads", 1.0),
    "robosuite": Peer("robosuite", 0.15),
    "maniskill": Peer("ManiSkill3, CPU", 0.15),
}


class Speed(NamedTuple):
    """Throws [1/s], and processor time of all processes for one throw [ms]."""

    throws_per_s: float
    cpu_ms_per_throw: float


def main() -> None:
    """Measure all in turns, as the machine's speed drifts, and print medians."""
    parser = argparse.ArgumentParser(prog="python -m bench.peers", description=__doc__)
    parser.add_argument("--rounds", type=int, default=5, help="measurements of each [%(default)s]")
    parser.add_argument("--trials", type=int, default=60, help="throws of each collection [%(default)s]")
    parser.add_argument("--figure", type=Path, metavar="FILE", help="write the plot of the documents there, an SVG")
    arguments = parser.parse_args()
    plans = {
        engine: collection.draw_unchecked_plan(
            load(CONFIG, [f"trials={arguments.trials}", f"sim.engine={engine}", "robot.locked=none"])
        )
        for engine in _PACKAGES
    }
    pythons = {name: _install(name) for name in PEERS}
    trials = (BUILD / "trials.npz").resolve()
    steps = _write_trials(plans["mujoco"], trials)
    rounds: dict[str, list[Speed]] = {}
    with tempfile.TemporaryDirectory(prefix="throwcollect-bench-") as scratch:
        for index in range(arguments.rounds):
            for at_once in (1, 2):
                place = Path(scratch) / f"{index}-{at_once}"
                kinds = list(_kinds(plans, at_once, arguments.trials, place, pythons, trials))
                for title, measure in kinds[:: -1 if index % 2 else 1]:
                    rounds.setdefault(f"{title}, {at_once}", []).append(measure())
                    print(index, title, at_once, rounds[f"{title}, {at_once}"][-1], file=sys.stderr)
    RESULT.write_text(json.dumps({"steps_per_throw": steps, "rounds": rounds}, indent=2) + "\n", encoding="utf-8")
    print(f"\n{steps:.0f} steps a throw, medians of {arguments.rounds}\n")
    print("| | throws/s | steps/s | processor time of a throw [ms] |\n|---|---|---|---|")
    costs = {}
    for title, speeds in rounds.items():
        rate, costs[title] = (statistics.median(values) for values in zip(*speeds, strict=True))
        print(f"| {title} | {rate:.1f} | {rate * steps:.0f} | {costs[title]:.1f} |")
    if arguments.figure is not None:
        one = {title.removesuffix(", 1"): cost for title, cost in costs.items() if title.endswith(", 1")}
        arguments.figure.write_text(_draw(dict(sorted(one.items(), key=lambda item: item[1]))), encoding="utf-8")
    print(f"\nall numbers: {RESULT}")


def _draw(costs: dict[str, float]) -> str:
    """Draw the throws per second of processor time as bars; an SVG."""
    # Titles of the table are Markdown.
    rates = {title.replace("`", ""): 1e3 / cost for title, cost in costs.items()}
    scale, left = 380 / max(rates.values()), 210
    bars = []
    for row, (title, rate) in enumerate(rates.items()):
        y, colour = 26 * row + 40, "#c2410c" if title.startswith("throwcollect") else "#64748b"
        bars.append(
            f'<text x="{left - 8}" y="{y + 14}" text-anchor="end">{title}</text>'
            f'<rect x="{left}" y="{y}" width="{rate * scale:.1f}" height="18" fill="{colour}"/>'
            f'<text x="{left + rate * scale + 6:.1f}" y="{y + 14}">{rate:.{1 if rate < 10 else 0}f}</text>'
        )
    height = 26 * len(rates) + 50
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 640 {height}" font-family="sans-serif" font-size="13">\n'
        f'<rect width="640" height="{height}" fill="white"/>\n'
        '<text x="12" y="24">Throws per second of processor time, one at once</text>\n' + "\n".join(bars) + "\n</svg>\n"
    )


def _kinds(
    plans: dict[str, Plan], at_once: int, throws: int, place: Path, pythons: dict[str, Path], trials: Path
) -> Iterator[tuple[str, Callable[[], Speed]]]:
    """List what is measured with so many at once: its title, and what measures it."""
    for engine, plan in plans.items():
        yield f"bare loop of {_PACKAGES[engine]}", partial(_measure_raw, plan, at_once, throws // 2)
        yield f"throwcollect, {engine}", partial(_collect, plan, at_once, Path(f"{place}-{engine}"))
    for name, peer in PEERS.items():
        count = max(1, int(throws * peer.share) // at_once)
        yield peer.title, partial(_run_peer, name, pythons[name], trials, at_once, count)


def _measure_raw(plan: Plan, processes: int, throws: int) -> Speed:
    return Speed(*raw.measure(plan, processes, throws // processes))


def _collect(plan: Plan, simulations: int, directory: Path) -> Speed:
    found = collection.measure(plan, simulations, directory)
    return Speed(found.throws_per_s, sum(found.cpu_ms_per_throw.values()))


def _run_peer(name: str, python: Path, trials: Path, at_once: int, throws: int) -> Speed:
    script = Path(__file__).with_name(f"with_{name}.py")
    # Libraries of numbers would start a thread for each core in each process.
    env = {**os.environ, "OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1", "CUDA_VISIBLE_DEVICES": ""}
    command = [str(python), str(script), str(trials), str(at_once), str(throws)]
    ended = subprocess.run(command, env=env, check=False, capture_output=True, text=True)
    if ended.returncode:
        sys.exit(f"{name} failed:\n{ended.stderr}")
    found = json.loads(ended.stdout.splitlines()[-1])
    if found["tracking_error_rad"] > _MOST_ERROR_RAD or found["flight_m"] < _LEAST_FLIGHT_M:
        sys.exit(f"{name} does not throw as it should: {found}")
    return Speed(found["throws_per_s"], found["cpu_ms_per_throw"])


def _install(name: str) -> Path:
    """Make the environment of a peer, once; the path of its Python."""
    directory, wanted = BUILD / name, Path(__file__).with_name(f"{name}.txt")
    python, done = directory / "bin" / "python", directory / "packages.txt"
    if not done.exists() or done.read_bytes() != wanted.read_bytes():
        print(f"installing {name} into {directory}", file=sys.stderr)
        uv = Path(sys.executable).with_name("uv")
        subprocess.run([uv, "venv", "--quiet", "--clear", "--python", sys.executable, directory], check=True)
        # All packages are listed: of robosuite, one peer only has the files.
        subprocess.run([uv, "pip", "install", "--quiet", "--no-deps", "--python", python, "-r", wanted], check=True)
        done.write_bytes(wanted.read_bytes())
    return python.absolute()


def _write_trials(plan: Plan, path: Path) -> float:
    """Write commands of some trials, in as many physics steps as throwcollect simulates; the mean number of steps."""
    positions, steps, releases = [], [], []
    with Simulator(plan.config) as simulator:
        for trial in plan.trials[:_DISTINCT]:
            throw = simulator.throw(trial.values)
            if throw.outcome != "landed":
                continue
            config = plan.config_of(trial)
            stride = config.sim.physics_hz // config.record.rate_hz
            positions.append(raw.commands_of(config).positions)
            steps.append((throw.row["samples"] - 1) * stride)
            releases.append(round(throw.row["release_time_s"] * config.sim.physics_hz))
    commands = np.array(positions)
    # So the fingers of a gripper open aside, and do not stop the ball.
    commands[:, :, 6] += _QUARTER_TURN
    np.savez(path, positions=commands, steps=steps, releases=releases)
    return float(np.mean(steps))


if __name__ == "__main__":
    main()
