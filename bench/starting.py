"""`python -m bench.starting`: how long many simulations take to start, and what their start costs each process.

The command itself is run, on the ballistic engine, whose throws cost next to nothing. Times count from the command on;
on a busy machine, compare processor times.
"""

from __future__ import annotations

import argparse
import json
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import psutil

CONFIG = Path(__file__).parents[1] / "configs" / "quickstart.yaml"
_ROLES = ("sim", "router", "coordinator")
_THROWS_EACH = 8
_LOOK_S = 0.2


def _role_of(process: psutil.Process) -> str:
    """The subcommand that a process runs; the command itself and the process that nodes are forked from are one."""
    words = process.cmdline()
    return next((role for role in _ROLES if f"throwcollect {role} " in " ".join(words)), "launcher")


def _ready(logs: Path, simulations: int) -> bool:
    said = (logs / f"sim_{index}.log" for index in range(simulations))
    return all(log.exists() and log.stat().st_size for log in said)


def measure(simulations: int, directory: Path) -> dict[str, float]:
    """Collect once, and look at all processes meanwhile."""
    settings = (f"trials={_THROWS_EACH * simulations}", "sim.engine=ballistic", "run.replay=0")
    options = [word for change in settings for word in ("--set", change)]
    options += ["--runtime", "local", "-n", str(simulations), "--output", str(directory)]
    found: dict[str, float] = {}
    spent: dict[tuple[str, int], float] = {}
    logs, began = directory / "logs", time.time()
    command = [sys.executable, "-m", "throwcollect", "up", str(CONFIG), *options]
    with subprocess.Popen(command, stdout=subprocess.DEVNULL) as running:
        root = psutil.Process(running.pid)
        while running.poll() is None:
            time.sleep(_LOOK_S)
            for process in (root, *root.children(recursive=True)):
                try:
                    role = _role_of(process)
                    spent[role, process.pid] = sum(process.cpu_times()[:2])
                    memory = f"memory of a {role} [MB]"
                    found[memory] = max(found.get(memory, 0.0), process.memory_info().rss / 1e6)
                except psutil.Error:
                    continue  # It has ended.
            if "all ready [s]" not in found and _ready(logs, simulations):
                found["all ready [s]"] = time.time() - began
                for role in {role for role, _ in spent}:
                    total_s = sum(spent_s for (each, _), spent_s in spent.items() if each == role)
                    found[f"{role}, until then [s of a processor]"] = total_s
    lines = (logs / "journal.jsonl").read_text(encoding="utf-8").splitlines()
    events = [json.loads(line) for line in lines]
    found["first throw [s]"] = next(each["time"] for each in events if each["event"] == "commit") - began
    first = {each["simulation"]: each["time"] for each in reversed(events) if each["event"] == "lease"}
    found["all working [s]"] = max(first.values()) - began
    found["simulations that worked"] = len(first)
    return found


def main() -> None:
    """Measure each number of simulations in turns, and print medians."""
    parser = argparse.ArgumentParser(prog="python -m bench.starting", description=__doc__)
    parser.add_argument("simulations", type=int, nargs="*", default=[8, 64], help="numbers of them [%(default)s]")
    parser.add_argument("--rounds", type=int, default=3, help="measurements of each [%(default)s]")
    arguments = parser.parse_args()
    found: dict[int, list[dict[str, float]]] = {simulations: [] for simulations in arguments.simulations}
    for number in range(arguments.rounds):
        for simulations, each in found.items():
            with tempfile.TemporaryDirectory(prefix="throwcollect-bench-") as scratch:
                each.append(measure(simulations, Path(scratch) / f"data-{number}"))
    print(f"| simulations | {' | '.join(map(str, found))} |\n|---|{'---|' * len(found)}")
    for name in sorted({name for rounds in found.values() for each in rounds for name in each}):
        medians = (statistics.median(each.get(name, 0.0) for each in rounds) for rounds in found.values())
        print(f"| {name} | {' | '.join(f'{median:.1f}' for median in medians)} |")


if __name__ == "__main__":
    main()
