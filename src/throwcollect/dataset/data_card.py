"""The data card of a dataset: what it holds for whoever finds it, and where it came from.

It is the only file that may differ between two collections of the same configuration.
"""

from __future__ import annotations

import os
import platform
import socket
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass
from datetime import datetime, timezone
from importlib.metadata import PackageNotFoundError, version

import pyarrow as pa
import pyarrow.compute as pc

from throwcollect.config.schema import Config
from throwcollect.dataset.bag import to_yaml
from throwcollect.dataset.directory import TRIALS
from throwcollect.sweep.plan import FIRST_TRIALS
from throwcollect.version import __version__

HOST_VARIABLE = "THROWCOLLECT_HOST"
"""Name of the machine for processes that cannot know it; empty if nobody does."""

_LIBRARIES = ("pybullet", "numpy", "rosbags", "mcap", "zstandard", "pyarrow", "pin", "example-robot-data")
_SIZES = ((1_000, "n<1K"), (10_000, "1K<n<10K"), (100_000, "10K<n<100K"), (1_000_000, "100K<n<1M"))
_MORE = "1M<n<10M"


@dataclass(frozen=True)
class Provenance:
    """How one collection was run.

    Attributes:
        finished: When it ended.
        host: Name of the machine that wrote the dataset; None if it is not known, as in a container.
        platform: Its system and processor.
        python: Version of Python.
        libraries: Versions of the libraries that the data pass through.
        simulations: Number of simulations; None if not known.
        wall_s: Real time that it took [s]; None if not known.
        was_open: Whether anybody who reached its router could join it.
    """

    finished: datetime
    host: str | None
    platform: str
    python: str
    libraries: Mapping[str, str]
    simulations: int | None
    wall_s: float | None
    was_open: bool

    @classmethod
    def of_this_machine(cls, *, simulations: int | None, wall_s: float | None, was_open: bool) -> Provenance:
        """Provenance of a collection that ends now, here."""
        return cls(
            finished=datetime.now(timezone.utc),
            # Of itself, a container knows nothing but a random id.
            host=os.environ.get(HOST_VARIABLE, socket.gethostname()) or None,
            platform=platform.platform(),
            python=platform.python_version(),
            libraries={"throwcollect": __version__, **_versions()},
            simulations=simulations,
            wall_s=wall_s,
            was_open=was_open,
        )


def _versions() -> dict[str, str]:
    found = {}
    for name in _LIBRARIES:
        # Not every machine that collects also simulates.
        with suppress(PackageNotFoundError):
            found[name] = version(name)
    return found


def count_outcomes(throws: pa.Table) -> dict[str, int]:
    """Number of trials of each outcome, most frequent first."""
    counts = {entry["values"]: entry["counts"] for entry in pc.value_counts(throws["outcome"]).to_pylist()}
    return dict(sorted(counts.items(), key=lambda item: (-item[1], item[0])))


def outcome_lines(throws: pa.Table) -> list[str]:
    """The table of outcomes of a data card, in Markdown."""
    counts = count_outcomes(throws).items()
    return ["| outcome | trials |", "|---|---|", *(f"| {outcome} | {count} |" for outcome, count in counts)]


def data_card(config: Config, throws: pa.Table, provenance: Provenance) -> str:
    """README.md of a dataset, with the YAML header that dataset hubs read.

    Args:
        config: The configuration.
        throws: One row a trial.
        provenance: How the collection was run.
    """
    episodes = len(throws) - throws["digest"].null_count
    size = next((label for limit, label in _SIZES if episodes < limit), _MORE)
    header = {
        "license": "apache-2.0",
        "pretty_name": config.name,
        "task_categories": ["robotics"],
        "tags": ["robotics", "throwing", "ros2", "mcap", "talos", "simulation"],
        "size_categories": [size],
        "configs": [{"config_name": "throws", "data_files": "throws.parquet"}],
    }
    lines = [
        "---",
        to_yaml(header) + "---",
        "",
        f"# {config.name}",
        "",
        f"{episodes} simulated throws of a ball by the humanoid robot Talos, each with the joint states of the robot "
        f"and the odometry of the ball at {config.record.rate_hz} Hz. Made with throwcollect.",
        "",
        *outcome_lines(throws),
        "",
        "## Files",
        "",
        "- `metadata.yaml` and `*.mcap`: the recordings, a rosbag2 bag (`ros2 bag info`, Foxglove, `rosbags`, `mcap`).",
        "- `throws.parquet`: one row a trial: swept values, outcome, release, apex, landing, place of its recording.",
        "- `plan.parquet`: the trials, each as it was drawn before it ran.",
        "- `config.yaml`: the configuration; collecting with it again yields the same data.",
        *([f"- `{TRIALS}`: the list of points that the configuration reads."] if config.sweep.file else []),
        "",
        *_ranges(config, throws),
        "## Limits",
        "",
        "Simulated with Bullet: rigid bodies, the base of the robot fixed, ideal motors within effort limits, no "
        "sensor noise. Throws that failed are kept; `outcome` says how.",
        "",
        "## Provenance",
        "",
        "| | |",
        "|---|---|",
        *(f"| {name} | {value} |" for name, value in _provenance(provenance).items()),
        "",
    ]
    return "\n".join(lines)


def _ranges(config: Config, throws: pa.Table) -> list[str]:
    rows = []
    for name in (name for name in throws.column_names if "." in name):
        limits = pc.min_max(throws[name]).as_py()
        rows.append(f"| `{name}` | {limits['min']:g} | {limits['max']:g} |")
    return [
        "## What varies",
        "",
        *_drawn(config),
        "",
        "| key | lowest | highest |",
        "|---|---|---|",
        *rows,
        "",
    ]


def _drawn(config: Config) -> list[str]:
    """How the values came about, one sentence a line."""
    lines = [f"Drawn by the sampler `{config.sweep.sampler}` with seed {config.seed}."]
    if config.sweep.target is not None:
        bins = [
            f"`{name}` from {each.min:g} to {each.max:g} in {each.bins} bins"
            for name, each in config.sweep.target.dimensions.items()
        ]
        lines.append(f"After {FIRST_TRIALS} trials, values were chosen that spread landings over {', '.join(bins)}.")
    if config.until is not None:
        lines.append(f"Collected until {config.until.landed} throws had landed, or all trials had been used up.")
    return lines


def _provenance(provenance: Provenance) -> dict[str, str]:
    facts = {
        "finished": provenance.finished.isoformat(timespec="seconds"),
        **({"host": provenance.host} if provenance.host else {}),
        "platform": provenance.platform,
        "Python": provenance.python,
        **provenance.libraries,
    }
    if provenance.simulations is not None:
        facts["simulations"] = str(provenance.simulations)
    if provenance.wall_s is not None:
        facts["wall time"] = f"{provenance.wall_s:.1f} s"
    if provenance.was_open:
        facts["open"] = "anybody who reached the router could join, read and disturb the collection"
    return facts
