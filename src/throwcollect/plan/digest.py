"""Hashes over everything that determines a plan or a trial."""

from __future__ import annotations

import hashlib
import json
import re
from collections.abc import Iterable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from throwcollect.config.key import Effect, key_of_field
from throwcollect.config.schema import Config
from throwcollect.config.section import Section
from throwcollect.config.values import leaves
from throwcollect.plan.trials import Points

_FORMAT = "throwcollect trial 1"
_DIGEST = re.compile(r"[0-9a-f]{64}")


def is_digest(value: object) -> bool:
    """Whether a value is a digest in hexadecimal."""
    return isinstance(value, str) and bool(_DIGEST.fullmatch(value))


def config_digest(config: Config) -> str:
    """Hash a configuration, SHA-256 in hex; keys that say how and where it is run do not count."""
    sections = config.model_dump(mode="json", exclude=_name_uncounted(config))
    return hashlib.sha256(json.dumps(sections).encode()).hexdigest()


def _name_uncounted(holder: Section | dict[str, Any]) -> dict[str, Any]:
    """Name the fields of a section and of its inner sections that do not count, in the form of pydantic's `exclude`."""
    uncounted: dict[str, Any] = {}
    for name, value in (holder if isinstance(holder, dict) else holder.__dict__).items():
        if isinstance(holder, Section) and key_of_field(type(holder), name).effect is Effect.RUN:
            uncounted[name] = True
        elif isinstance(value, Section | dict) and (inside := _name_uncounted(value)):
            uncounted[name] = inside
    return uncounted


def trial_digests(config: Config, points: Points, seeds: Iterable[int]) -> NDArray[np.uint8]:
    """Hash everything that determines the samples of each trial, SHA-256, shape ``(n_trials, 32)``.

    The hashed text has one line ``key=value`` for each effective key of the trial's configuration, sorted by key, so
    it does not matter whether a value was swept or fixed.
    """
    lines = {leaf.name: _format_line(leaf.name, leaf.value) for leaf in leaves(config) if leaf.key.determines_samples}
    # Whatever differs from trial to trial has an empty line here, so that lines are sorted once for all trials.
    lines["seed"] = ""
    lines |= dict.fromkeys(points.keys, "")
    lines = dict(sorted(lines.items()))
    digests = np.empty((len(points.values), hashlib.sha256().digest_size), np.uint8)
    for digest, seed, row in zip(digests, seeds, points.values, strict=True):
        lines["seed"] = _format_line("seed", int(seed))
        for key, value in zip(points.keys, row.tolist(), strict=True):
            lines[key] = _format_line(key, value)
        text = "\n".join([_FORMAT, *lines.values()])
        digest[:] = np.frombuffer(hashlib.sha256(text.encode()).digest(), np.uint8)
    return digests


def _format_line(key: str, value: object) -> str:
    return f"{key}={json.dumps(value)}"
