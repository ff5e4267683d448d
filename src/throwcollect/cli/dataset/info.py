"""`throwcollect dataset info|digest`: what is in a dataset."""

from __future__ import annotations

import json as jsonlib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import typer

from throwcollect.dataset.inspect import digest, info


def show_info(directory: Path, *, json: bool) -> None:
    """Print what a dataset holds.

    Raises:
        DatasetError: If the directory holds no finished dataset.
    """
    found = info(directory).as_dict()
    typer.echo(jsonlib.dumps(found, indent=2) if json else describe(found), nl=json)


def show_digest(directory: Path) -> None:
    """Print one hash over all episodes in trial order.

    Raises:
        DatasetError: If the directory holds no finished dataset, or an episode is damaged.
    """
    typer.echo(digest(directory))


def describe(found: Mapping[str, Any]) -> str:
    """Summary of a dataset in words, one fact a line.

    Args:
        found: `Info` as dictionary; beside it, whether the run was `open` is told, too.
    """
    outcomes = ", ".join(f"{count} {outcome}" for outcome, count in found["outcomes"].items())
    lines = {
        "trials": f"{found['trials']}: {outcomes}{_missing(found)}",
        "landing": _landing(found.get("landing")),
        "episodes": f"{found['episodes']}, {found['samples']} samples, {found['duration_s']:.0f} s of simulated time",
        "files": f"{found['shards']} MCAP of {found['recordings_bytes'] / 1e6:.1f} MB, "
        f"{found['size_bytes'] / 1e6:.1f} MB in all",
        "topics": ", ".join(f"{topic} ({count})" for topic, count in found["topics"].items()),
        "digest": found["digest"],
    }
    if wall_s := found.get("wall_s"):
        lines["took"] = f"{wall_s:.1f} s, {found['episodes'] / wall_s:.1f} throws/s, start-up included"
    if found.get("open"):
        lines["open"] = "anybody who reached the router could join, read and disturb the run"
    width = max(map(len, lines))
    return "".join(f"{key:{width}}  {text}\n" for key, text in lines.items())


def _missing(found: Mapping[str, Any]) -> str:
    wanted = found.get("wanted")
    if wanted is None or found["outcomes"].get("landed", 0) >= wanted:
        return ""
    return f"; {wanted} should have landed, but all trials were used up"


def _landing(landing: Mapping[str, Any] | None) -> str:
    if landing is None:
        return "no ball landed"
    x, y = landing["x_m"], landing["y_m"]
    return f"x {x[0]:.3f} to {x[1]:.3f} m, y {y[0]:.3f} to {y[1]:.3f} m"
