"""Hashes over what determines a plan and a trial."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterator, Sequence
from functools import reduce
from operator import getitem

from throwcollect.config.controllers import ControllersConfig
from throwcollect.config.schema import Config
from throwcollect.config.values import leaves
from throwcollect.sweep.points import Points

_FORMAT = "throwcollect trial 1"

# What does not change the samples of a trial: names and numbers of trials, how and where they are run, how fast they
# are shown, and how samples are packed into files. The root seed acts through the values and the seed of each trial.
_RUN = frozenset({"run", "containers"})
_WITHOUT_EFFECT = _RUN | {"name", "trials", "until", "sweep"}
_WITHOUT_EFFECT_INSIDE = frozenset(
    {"sim.real_time_factor", "record.zstd_level", "record.trials_per_shard", "controllers.names"}
)

# Keys that came later count where they differ from their defaults, so that older digests hold.
_LATER_KEYS: dict[str, object] = {
    "controllers": ControllersConfig().model_dump(mode="json"),
    "until": None,
    "sweep.target": None,
}
_LATER = {f"controllers.{key}": value for key, value in ControllersConfig().model_dump(mode="json").items()}


def config_digest(config: Config) -> str:
    """SHA-256 in hex over a configuration; its sections `run` and `containers`, and their keys, do not count."""
    sections = config.model_dump(mode="json", exclude=set(_RUN))
    for key, default in _LATER_KEYS.items():
        *above, last = key.split(".")
        holder = reduce(getitem, above, sections)
        if holder[last] == default:
            del holder[last]
    return hashlib.sha256(json.dumps(sections).encode()).hexdigest()


def determines_samples(key: str) -> bool:
    """Whether the value of a dotted configuration key may change the samples of a trial."""
    return key.partition(".")[0] not in _WITHOUT_EFFECT and key not in _WITHOUT_EFFECT_INSIDE


def trial_digests(config: Config, points: Points, seeds: Sequence[int]) -> Iterator[str]:
    """SHA-256 in hex over everything that determines the samples of each trial.

    The hashed text has one line ``key=value`` for each effective key of the trial's configuration, sorted by key, so
    it does not matter whether a value was swept or fixed.

    Args:
        config: Configuration that the trials vary.
        points: Values of the trials.
        seeds: Seeds of the trials.
    """
    lines = {
        key: _line(key, value)
        for key, value in sorted(leaves(config))
        if determines_samples(key) and not (key in _LATER and value == _LATER[key])
    }
    for seed, row in zip(seeds, points.values.tolist(), strict=True):
        lines["seed"] = _line("seed", seed)
        for key, value in zip(points.keys, row, strict=True):
            lines[key] = _line(key, value)
        yield hashlib.sha256("\n".join([_FORMAT, *lines.values()]).encode()).hexdigest()


def _line(key: str, value: object) -> str:
    return f"{key}={json.dumps(value)}"
