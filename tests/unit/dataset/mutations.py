"""Damages files as disks, programs and people do."""

from __future__ import annotations

import json
import random
import struct
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from hypothesis import strategies as st

from throwcollect.collect.coordinator.resume import finish_without_simulating
from throwcollect.config.loader import load
from throwcollect.dataset.directory import config_path
from throwcollect.dataset.inspect import info
from throwcollect.dataset.manifest import entry_of_file, list_promised_names, manifest_text
from throwcollect.dataset.mcap_reader import scan_file
from throwcollect.dataset.reader import Dataset
from throwcollect.dataset.verify import verify

KINDS = ("flip", "delete", "repeat", "insert", "cut", "length 32", "length 64", "copy", "zero")
LENGTHS = (0, 1, 2**16, 2**31 - 1, 2**32 - 1, 2**40, 2**63 - 1, 2**63, 2**64 - 1)
SETTINGS = {"trials": 2, "record": {"trials_per_shard": 1, "rate_hz": 50}}
"""A dataset small enough to be read thousands of times."""


class Mutation(NamedTuple):
    """One damage: its kind, where, how long, and a number that some kinds need; shares are of the file's size."""

    kind: str
    place: float
    span: int
    number: int


any_mutation = st.builds(
    Mutation,
    kind=st.sampled_from(KINDS),
    place=st.floats(0, 1),
    span=st.integers(1, 4096),
    number=st.integers(0, 2**32 - 1),
)


def mutate(data: bytes, mutations: Sequence[Mutation]) -> bytes:
    damaged = bytearray(data)
    for kind, share, span, number in mutations:
        at = min(int(share * len(damaged)), len(damaged))
        if kind == "flip" and damaged:
            for place in range(at, min(at + span, len(damaged)), 1 + number % 97):
                damaged[place] ^= 1 << number % 8
        elif kind == "delete":
            del damaged[at : at + span]
        elif kind == "repeat":
            damaged[at:at] = damaged[at : at + span]
        elif kind == "insert":
            damaged[at:at] = random.Random(number).randbytes(span)
        elif kind == "cut":
            del damaged[at:]
        elif kind == "length 32":
            damaged[at : at + 4] = struct.pack("<I", LENGTHS[number % len(LENGTHS)] % 2**32)
        elif kind == "length 64":
            damaged[at : at + 8] = struct.pack("<Q", LENGTHS[number % len(LENGTHS)])
        elif kind == "copy":
            source = number % (len(damaged) + 1)
            damaged[at : at + span] = damaged[source : source + span]
        elif kind == "zero":
            damaged[at : at + span] = bytes(len(damaged[at : at + span]))
    return bytes(damaged)


def fit_manifest(directory: Path) -> None:
    """Write a manifest that fits the files, so that it does not give a change away."""
    files = [directory / name for name in list_promised_names(directory) if (directory / name).is_file()]
    name = json.loads((directory / "datapackage.json").read_bytes())["name"]
    (directory / "datapackage.json").write_text(manifest_text(name, map(entry_of_file, files)))


def finish(directory: Path) -> None:
    """Finish a dataset with what is whole."""
    finish_without_simulating(load(config_path(directory)), directory, sweep_directory=directory)


def use(directory: Path) -> None:
    """Read every episode, as a user of the library does."""
    for episode in Dataset.open(directory).episodes():
        episode.samples()
        episode.chunk.check_records()


def outcomes(directory: Path, name: str) -> list[Callable[[], Any]]:
    """All functions that read a dataset, to be called when this file of it is damaged."""
    calls: list[Callable[[], Any]] = [
        lambda: verify(directory),
        lambda: use(directory),
        lambda: info(directory),
        lambda: finish(directory),
    ]
    return [lambda: list(scan_file(directory / name)), *calls] if name.endswith(".mcap") else calls
