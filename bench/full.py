"""`python -m bench.full`: a database of 9,824 landed throws, collected once in peace and once among crashes.

Both collections are the command itself, unattended. In the second one, processes are killed with SIGKILL at random
moments: a simulation, the router, the coordinator, the launcher, and at last all of them together. Where that ends the
command, it is resumed. All files of both datasets must be the same.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import os
import random
import subprocess
import sys
import tempfile
import time
from collections import Counter
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

import psutil

from throwcollect.dataset.inspect import info
from throwcollect.dataset.journal import read_journal
from throwcollect.dataset.verify import verify
from throwcollect.side_by_side import count_cores
from throwcollect.state_directory import STATE_VARIABLE

CONFIG = Path(__file__).parents[1] / "configs" / "quickstart.yaml"
LANDED = 9_824
"""Throws of the published database of the Jozef Stefan Institute."""
VICTIMS = ("sim", "router", "coordinator", "launcher", "everything")
_POLL_S = 0.5


@dataclass
class Collected:
    """What one collection cost.

    Attributes:
        wall_s: From the first command to the end of the last one [s].
        commands: Number of commands: 1, and one more for each resumption.
        killed: What was killed, and after how many episodes.
        memory_mb: Largest resident memory of a process of each role [MB].
        leases: How often trials were given to a simulation.
        commits: Number of episodes written.
    """

    wall_s: float = 0.0
    commands: int = 0
    killed: list[tuple[str, int]] = field(default_factory=list)
    memory_mb: dict[str, float] = field(default_factory=dict)
    leases: int = 0
    commits: int = 0


def _throwcollect(*arguments: str | Path) -> list[str]:
    return [sys.executable, "-m", "throwcollect", *map(str, arguments)]


def _nodes(launcher: psutil.Process) -> list[tuple[str, psutil.Process]]:
    found = [("launcher", launcher)]
    # Nodes are forked by a child that has imported their libraries.
    for child in launcher.children(recursive=True):
        words = " ".join(child.cmdline()).split()
        found += [(role, child) for role in ("sim", "router", "coordinator") if role in words]
    return found


def _look(launcher: psutil.Process, memory_mb: dict[str, float]) -> None:
    for role, process in _nodes(launcher):
        memory_mb[role] = max(memory_mb.get(role, 0.0), process.memory_info().rss / 1e6)


def _kill(launcher: psutil.Process, victim: str) -> None:
    nodes = _nodes(launcher)
    for _, process in nodes if victim == "everything" else [each for each in nodes if each[0] == victim][:1]:
        process.kill()


def collect(directory: Path, *, engine: str, landed: int, simulations: int, kills: list[tuple[int, str]]) -> Collected:
    """Run the command to its end, and resume it as often as it takes.

    Args:
        directory: Directory of the dataset.
        engine: What simulates.
        landed: Number of throws that have to land.
        simulations: Number of simulations.
        kills: After how many written episodes what is killed, in order.
    """
    collected = Collected()
    options = ["-n", str(simulations), "--runtime", "local", "--json"]
    changes = (f"until.landed={landed}", "trials=null", f"sim.engine={engine}")
    settings = [word for change in changes for word in ("--set", change)]
    command = _throwcollect("up", CONFIG, "--output", directory, *settings, *options)
    journal = directory / "logs" / "journal.jsonl"
    left = list(kills)
    written = looked = 0
    began = time.monotonic()
    while True:
        collected.commands += 1
        with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True) as process:
            launcher = psutil.Process(process.pid)
            while process.poll() is None:
                time.sleep(_POLL_S)
                try:
                    _look(launcher, collected.memory_mb)
                    fresh = journal.read_bytes()[looked:] if journal.exists() else b""
                    looked += len(fresh)
                    written += fresh.count(b'"event": "commit"')
                    if left and written >= left[0][0]:
                        collected.killed.append((left[0][1], written))
                        _kill(launcher, left.pop(0)[1])
                        print(f"killed after {written} episodes: {collected.killed[-1][0]}", flush=True)
                except psutil.NoSuchProcess:
                    continue
            said = process.stdout.read() if process.stdout else ""
        if process.returncode == 0:
            break
        if process.returncode > 0:
            raise RuntimeError(said)
        command = _throwcollect("resume", directory, *options)
    collected.wall_s = time.monotonic() - began
    counts = Counter(entry.event for entry in read_journal(journal))
    collected.leases, collected.commits = counts["lease"], counts["commit"]
    return collected


def _fingerprints(directory: Path) -> dict[str, str]:
    return {
        path.name: hashlib.sha256(path.read_bytes()).hexdigest()
        for path in sorted(directory.iterdir())
        if path.is_file() and path.name not in ("README.md", "provenance.json")
    }


def main() -> None:
    """Collect twice, compare, verify, and print the table."""
    parser = argparse.ArgumentParser(prog="python -m bench.full", description=__doc__)
    parser.add_argument("--landed", type=int, default=LANDED, help="throws that have to land [%(default)s]")
    parser.add_argument("--engine", default="bullet", help="what simulates: bullet or mujoco [%(default)s]")
    parser.add_argument("-n", type=int, default=2, help="simulations [%(default)s]")
    parser.add_argument(
        "--seed", type=int, default=0, help="of the moments at which processes are killed [%(default)s]"
    )
    arguments = parser.parse_args()
    moments = random.Random(arguments.seed)
    victims = moments.sample(VICTIMS, len(VICTIMS))
    when = sorted(moments.randrange(arguments.landed // 50, arguments.landed) for _ in victims)
    with tempfile.TemporaryDirectory(prefix="throwcollect-bench-") as scratch:
        clean, disturbed = Path(scratch) / "clean", Path(scratch) / "disturbed"
        # A launcher that is killed leaves the record of its run, which is none of the user's.
        os.environ[STATE_VARIABLE] = str(Path(scratch) / "state")
        rows = {
            name: collect(
                directory, engine=arguments.engine, landed=arguments.landed, simulations=arguments.n, kills=kills
            )
            for name, directory, kills in (
                ("in peace", clean, []),
                ("among crashes", disturbed, list(zip(when, victims, strict=True))),
            )
        }
        same = _fingerprints(clean) == _fingerprints(disturbed)
        found = info(disturbed)
        began = time.monotonic()
        findings = verify(disturbed, processes=count_cores())
        verify_s = time.monotonic() - began
    report = {
        "landed": found.outcomes["landed"],
        "trials": found.trials,
        "digest": found.digest,
        "same_files": same,
        "findings": [str(finding) for finding in findings],
        "verify_s": verify_s,
        "bytes_per_throw": found.size_bytes / found.episodes,
        **{name: asdict(row) for name, row in rows.items()},
    }
    result = Path(f"build/bench-full-{arguments.engine}.json")
    result.parent.mkdir(exist_ok=True)
    result.write_text(json.dumps(report, indent=2) + "\n", encoding="utf-8")
    _print(report, rows, episodes=found.episodes)
    print(f"all numbers: {result}")
    if not same or findings:
        raise SystemExit("the datasets differ" if not same else "verify found something")


def _print(report: dict[str, Any], rows: dict[str, Collected], *, episodes: int) -> None:
    print(f"\n{report['landed']} landed throws of {report['trials']} trials, digest {report['digest'][:8]}…")
    print(f"\n| | {' | '.join(rows)} |\n|---|{'---|' * len(rows)}")

    def row(what: str, *values: str) -> None:
        print(f"| {what} | {' | '.join(values)} |")

    row("wall time", *(f"{each.wall_s:.0f} s" for each in rows.values()))
    row("throws/s, start to end", *(f"{episodes / each.wall_s:.1f}" for each in rows.values()))
    row("commands (1, and resumptions)", *(str(each.commands) for each in rows.values()))
    row("killed", *(", ".join(f"{what} at {when}" for what, when in each.killed) or "–" for each in rows.values()))
    row("trials leased / episodes written", *(f"{each.leases} / {each.commits}" for each in rows.values()))
    for role in ("sim", "router", "coordinator", "launcher"):
        row(f"peak memory of a {role}", *(f"{each.memory_mb[role]:.0f} MB" for each in rows.values()))
    print(f"\n{report['bytes_per_throw'] / 1e3:.1f} kB a throw; verify took {report['verify_s']:.0f} s: ", end="")
    print("nothing wrong" if not report["findings"] else report["findings"])
    print("all files are the same" if report["same_files"] else "THE FILES DIFFER")


if __name__ == "__main__":
    main()
