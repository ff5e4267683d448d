"""Attacks a collection in all ways that have a seed, and counts what was noticed; a small one runs with the tests.

``python -m tests.campaign`` takes about an hour and prints a table like that of ``docs/reliability.md``. Its kinds:

- *flips*: single bits of all files of a collected dataset but logs; each must be seen by comparing with the manifest,
  and each hundredth also by the whole of `verify`.
- *kills*: collections whose nodes, coordinator or launcher get signals at any moment, gone on with until they are
  finished; the files must be those of an undisturbed collection.

Intruders, impostors and links have no seed: `tests/e2e/test_intruders.py`, `tests/e2e/test_impostors.py` and
`tests/unit/dataset/test_links.py` try each of theirs.
"""

from __future__ import annotations

import argparse
import random
import signal
import sys
import tempfile
import time
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

import psutil

from tests.e2e.collection import SEEING, Running, collect_here, fingerprints, launch, start, words_of, write_config
from throwcollect.dataset.manifest import list_promised_names
from throwcollect.dataset.verify import find_damage, verify

MANIFEST, CARD, PROVENANCE = "datapackage.json", "README.md", "provenance.json"
TRIALS = 40
SIGNALS = (signal.SIGKILL, signal.SIGTERM, signal.SIGINT, signal.SIGHUP, signal.SIGSTOP)
_WHOLE_VERIFY_EVERY = 100
_MOST_DISTURBANCES = 8
_FROZEN_S = 1.0


@dataclass
class Count:
    """What came of one kind of attack.

    Attributes:
        tried: How many there were.
        missed: Those that nobody noticed, or that changed a dataset, in words.
    """

    tried: int = 0
    missed: list[str] = field(default_factory=list)


def flips(directory: Path, count: int, source: random.Random) -> Count:
    """Flip single bits of a dataset, one at a time; the dataset is as it was when this returns."""
    result = Count()
    names = [*list_promised_names(directory), MANIFEST, CARD, PROVENANCE]
    for number in range(count):
        # All files alike, however large they are.
        path = directory / source.choice(names)
        whole = path.read_bytes()
        place, bit = source.randrange(len(whole)), source.randrange(8)
        damaged = bytearray(whole)
        damaged[place] ^= 1 << bit
        path.write_bytes(damaged)
        seen = bool(list(find_damage(directory, in_full=True)))
        if number % _WHOLE_VERIFY_EVERY == 0:
            seen = seen and bool(verify(directory))
        path.write_bytes(whole)
        result.tried += 1
        if not seen:
            result.missed.append(f"bit {bit} of byte {place} of {path.name}")
    return result


def kills(config: Path, reference: Path, scratch: Path, count: int, source: random.Random) -> Count:
    """Send signals to the parties of collections, `count` in all, and compare what is collected in the end."""
    result = Count()
    wanted = fingerprints(reference)
    collections = 0
    while result.tried < count:
        # A collection may end before any signal reaches it; the next one needs another directory all the same.
        directory = scratch / f"killed-{collections}"
        collections += 1
        said: list[str] = []
        running = start(config, directory, 4)
        code = -1
        while code != 0 and len(said) < _MOST_DISTURBANCES:
            for done in _disturbances(running, source):
                said.append(done)
                result.tried += 1
            code, _, err = running.finish()
            if code != 0:
                running = _go_on(config, directory)
        if code != 0:
            code, _, err = running.finish()
        if code != 0:
            result.missed.append(f"exit code {code} after {said}: {err}")
        elif fingerprints(directory) != wanted:
            result.missed.append(f"other files after {said}")
        if left := [
            each
            for each in psutil.process_iter(["cmdline"])
            if str(directory) in " ".join(each.info["cmdline"] or []).split()
        ]:
            result.missed.append(f"{len(left)} processes left after {said}")
    return result


def _go_on(config: Path, directory: Path) -> Running:
    """The collection into a directory once more: from what is there, or from its beginning if nothing is."""
    begun = (directory / "plan.parquet").exists() or (directory / "config.yaml").exists()
    where = ("--resume", directory) if begun else ("--output", directory)
    return launch(directory, "up", "-n", "2", "--runtime", "local", config, *where)


def _disturbances(running: Running, source: random.Random) -> Iterator[str]:
    """Up to three signals to parties of a collection; yields what was done."""
    for _ in range(source.randrange(1, 4)):
        time.sleep(source.uniform(0.2, 4.0))
        if running.process.poll() is not None:
            return
        try:
            launcher = psutil.Process(running.process.pid)
            parties = [launcher, *launcher.children(recursive=True)]
            victim, number = source.choice(parties), source.choice(SIGNALS)
            name = " ".join(words_of(victim)[-1:])
            victim.send_signal(number)
            if number == signal.SIGSTOP:
                time.sleep(source.uniform(0.0, _FROZEN_S))
                victim.send_signal(signal.SIGCONT)
        except psutil.NoSuchProcess:
            continue
        yield f"{number.name} to {'the launcher' if victim == launcher else name}"


def run(*, seed: int, flip_count: int, kill_count: int, scratch: Path, sim: str = "") -> dict[str, Count]:
    """Collect a dataset with these keys of ``sim``, attack it and its like, and count."""
    source = random.Random(seed)
    config = write_config(scratch, trials=TRIALS, text=SEEING, sim=sim)
    reference = scratch / "reference"
    collect_here(config, reference)
    return {
        "flips": flips(reference, flip_count, source),
        "kills": kills(config, reference, scratch, kill_count, source),
    }


def main() -> int:
    """Run a long campaign and print its counts."""
    parser = argparse.ArgumentParser(
        prog="python -m tests.campaign",
        description=__doc__,
        # The list of kinds stays a list.
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--flips", type=int, default=20_000, help="bits that are flipped")
    parser.add_argument("--kills", type=int, default=100, help="signals that are sent, or a few more")
    wanted = parser.parse_args()
    with tempfile.TemporaryDirectory(prefix="throwcollect-campaign-") as scratch:
        counts = run(
            seed=wanted.seed,
            flip_count=wanted.flips,
            kill_count=wanted.kills,
            scratch=Path(scratch),
        )
    print("| attack | tried | missed |\n|---|---|---|")
    for kind, count in counts.items():
        print(f"| {kind} | {count.tried} | {len(count.missed)} |")
    for missed in (each for count in counts.values() for each in count.missed):
        print(f"missed: {missed}", file=sys.stderr)
    return 1 if any(count.missed for count in counts.values()) else 0


if __name__ == "__main__":
    sys.exit(main())
