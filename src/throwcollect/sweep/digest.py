"""Hashes over what determines a plan and a trial."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterator, Sequence
from typing import Any

from throwcollect.config.key import Effect, key_of_field
from throwcollect.config.schema import Config
from throwcollect.config.section import Section
from throwcollect.config.values import leaves
from throwcollect.sweep.points import Points

_FORMAT = "throwcollect trial 1"


def config_digest(config: Config) -> str:
    """Hash a configuration, SHA-256 in hex; how and where it is run does not count.

    Keys that came later count where they differ from their defaults, so that older digests hold.
    """
    sections = config.model_dump(mode="json", exclude=_name_uncounted(config))
    return hashlib.sha256(json.dumps(sections).encode()).hexdigest()


def _name_uncounted(section: Section) -> dict[str, Any]:
    """Name the fields of a section, and of those in it, that do not count, as pydantic wants to have them named."""
    uncounted: dict[str, Any] = {}
    for name, value in section.__dict__.items():
        key = key_of_field(type(section), name)
        if key.effect is Effect.RUN or (key.later and value == type(section).model_fields[name].get_default()):
            uncounted[name] = True
        elif isinstance(value, Section) and (inside := _name_uncounted(value)):
            uncounted[name] = inside
    return uncounted


def trial_digests(config: Config, points: Points, seeds: Sequence[int]) -> Iterator[str]:
    """Hash everything that determines the samples of each trial, SHA-256 in hex.

    The hashed text has one line ``key=value`` for each effective key of the trial's configuration, sorted by key, so
    it does not matter whether a value was swept or fixed.

    Args:
        config: Configuration that the trials vary.
        points: Values of the trials.
        seeds: Seeds of the trials.
    """
    lines = {
        leaf.name: _line(leaf.name, leaf.value)
        for leaf in leaves(config)
        if leaf.key.determines_samples and not (leaf.key.later and leaf.is_default)
    }
    lines["seed"] = ""
    lines = dict(sorted(lines.items()))
    for seed, row in zip(seeds, points.values.tolist(), strict=True):
        lines["seed"] = _line("seed", seed)
        for key, value in zip(points.keys, row, strict=True):
            lines[key] = _line(key, value)
        yield hashlib.sha256("\n".join([_FORMAT, *lines.values()]).encode()).hexdigest()


def _line(key: str, value: object) -> str:
    return f"{key}={json.dumps(value)}"
