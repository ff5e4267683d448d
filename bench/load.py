"""`python -m bench.load`: many simulations while the machine is busy with other work.

The same throws are collected twice by the command itself, with one simulation in peace, and with many while other
processes do nothing but compute. However slow that is, it must come to its end without losing a trial, and the datasets
must be the same.
"""

from __future__ import annotations

import argparse
import itertools
import json
import multiprocessing
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from throwcollect.dataset.inspect import info

CONFIG = Path(__file__).parents[1] / "configs" / "quickstart.yaml"
_ASKED_AGAIN = "no answer to the lease"


@dataclass(frozen=True)
class Collected:
    """What became of one collection.

    Attributes:
        code: Exit code of the command; None if it was ended because its time was up.
        wall_s: Time of the whole command [s].
        throwing_s: From the first trial that was given to a simulation to the last episode that was written [s].
        longest_wait_s: Longest time in between without a new episode [s].
        leases: How often trials were given to a simulation.
        commits: Number of episodes written.
        failures: Why trials were taken back from simulations, and how often.
        asked_again: How often a simulation was sent its trials again.
        lost: Number of trials that were given up.
        digest: Digest of the dataset; empty if it is not finished.
    """

    code: int | None
    wall_s: float
    throwing_s: float
    longest_wait_s: float
    leases: int
    commits: int
    failures: dict[str, int]
    asked_again: int
    lost: int
    digest: str


def _compute() -> None:
    while True:
        pass


@contextmanager
def _busy(loops: int) -> Iterator[None]:
    processes = [multiprocessing.Process(target=_compute, daemon=True) for _ in range(loops)]
    for process in processes:
        process.start()
    yield
    for process in processes:
        process.kill()


def collect(directory: Path, *, simulations: int, trials: int, limit_s: float) -> Collected:
    """Run the command to its end, or until its time is up.

    Args:
        directory: Directory of the dataset.
        simulations: Number of simulations, on the ballistic engine.
        trials: Number of throws.
        limit_s: Longest time of the command [s].
    """
    settings = [word for change in (f"trials={trials}", "sim.engine=ballistic") for word in ("--set", change)]
    options = ["--runtime", "local", "-n", str(simulations), "--output", str(directory), *settings]
    began = time.monotonic()
    with subprocess.Popen([sys.executable, "-m", "throwcollect", "up", str(CONFIG), *options]) as process:
        code: int | None = None
        try:
            code = process.wait(limit_s)
        except subprocess.TimeoutExpired:
            process.terminate()
    wall_s = time.monotonic() - began
    lines = (directory / "logs" / "journal.jsonl").read_text(encoding="utf-8").splitlines()
    events = [json.loads(line) for line in lines]
    counts = Counter(event["event"] for event in events)
    first = [event["time"] for event in events if event["event"] == "lease"][:1]
    times = first + [event["time"] for event in events if event["event"] == "commit"]
    log = (directory / "logs" / "coordinator.log").read_text(encoding="utf-8")
    return Collected(
        code=code,
        wall_s=wall_s,
        throwing_s=times[-1] - times[0] if times else 0.0,
        longest_wait_s=max((after - before for before, after in itertools.pairwise(times)), default=0.0),
        leases=counts["lease"],
        commits=counts["commit"],
        failures=dict(Counter(event["reason"] for event in events if event["event"] == "fail")),
        asked_again=log.count(_ASKED_AGAIN),
        lost=counts["lost"],
        digest=info(directory).digest if code == 0 else "",
    )


def main() -> None:
    """Collect twice, and print the table.

    Raises:
        SystemExit: If the second collection did not come to its end, a trial was lost, or the datasets differ.
    """
    parser = argparse.ArgumentParser(prog="python -m bench.load", description=__doc__)
    parser.add_argument("-n", type=int, default=64, help="simulations [%(default)s]")
    parser.add_argument("--loops", type=int, default=16, help="processes that compute [%(default)s]")
    parser.add_argument("--trials", type=int, default=600, help="throws [%(default)s]")
    parser.add_argument("--limit-s", type=float, default=600.0, help="longest time of a collection [%(default)s]")
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory(prefix="throwcollect-bench-") as scratch:
        collected = {}
        for name, simulations, loops in (("in peace", 1, 0), ("busy", arguments.n, arguments.loops)):
            with _busy(loops):
                collected[f"{name}: {simulations} simulations, {loops} loops"] = collect(
                    Path(scratch) / name, simulations=simulations, trials=arguments.trials, limit_s=arguments.limit_s
                )
    print(f"\n| | {' | '.join(collected)} |\n|---|{'---|' * len(collected)}")
    alone, busy = collected.values()
    for field in vars(alone):
        values = (vars(each)[field] for each in (alone, busy))
        print(f"| {field} | {' | '.join(f'{v:.1f}' if isinstance(v, float) else str(v) for v in values)} |", flush=True)
    if busy.code != 0 or busy.digest != alone.digest:
        raise SystemExit("trials were lost, time was up, or the datasets differ")


if __name__ == "__main__":
    main()
