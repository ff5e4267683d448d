"""The conditions that an episode was simulated under, which are worked out twice and compared.

The coordinator works out the conditions of a trial from the plan, and the simulation from what it has really used. An
episode whose conditions differ does not belong to the plan, for whatever reason.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any

from pydantic import TypeAdapter, ValidationError

from throwcollect.build import build_digest
from throwcollect.config.key import Effect
from throwcollect.config.schema import Config
from throwcollect.config.values import leaves, sweepable_keys
from throwcollect.errors import DatasetError

_MOST_TOLD = 3
"""Largest number of differences that the reason for refusing one episode names."""
_EFFECTS_IN_DIGEST = (Effect.PHYSICS, Effect.ENCODING)


@dataclass(frozen=True)
class Conditions:
    """The conditions of one episode.

    Attributes:
        build: Digest of sources, engine and model (`build_of`).
        settings: Digest of the keys of the collection's configuration that concern the simulation.
        values: Values of the trial that replace those of the configuration, by dotted key.
        trajectory: Digest of the joint trajectory that the controllers were given; empty if there was no lease.
    """

    build: str
    settings: str
    values: Mapping[str, float]
    trajectory: str

    def to_json(self) -> str:
        """Write the conditions in JSON; equal conditions give equal text."""
        return json.dumps(asdict(self), sort_keys=True)

    def differences(self, expected: Conditions) -> Iterator[str]:
        """Describe each difference from the expected conditions in a phrase."""
        if self.build != expected.build:
            yield "its sources, its physics engine or its robot model are not those of the coordinator"
        if self.settings != expected.settings:
            yield "its configuration is another one"
        for key in sorted({*self.values, *expected.values}):
            used, planned = self.values.get(key), expected.values.get(key)
            if used != planned:
                yield f"{key} was {_describe(used)}, not {_describe(planned)}"
        if self.trajectory != expected.trajectory:
            yield "its controllers were given another trajectory"

    def explain(self, expected: Conditions) -> str | None:
        """Say why an episode under these conditions is not the one that was asked for; None if it is."""
        differences = list(self.differences(expected))
        more = f" and {len(differences) - _MOST_TOLD} more" if len(differences) > _MOST_TOLD else ""
        return "; ".join(differences[:_MOST_TOLD]) + more or None


def build_of(config: Config) -> str:
    """Digest of what computes the episodes of a configuration here (`build.build_digest`)."""
    return build_digest(config.sim.engine, config.robot.name, config.tool.name, config.task.name)


def _describe(value: float | None) -> str:
    return "as configured" if value is None else repr(value)


_CONDITIONS = TypeAdapter(Conditions)


def conditions_from_json(text: str) -> Conditions:
    """Read what `Conditions.to_json` writes."""
    try:
        return _CONDITIONS.validate_json(text, strict=True)
    except ValidationError as error:
        raise DatasetError(f"conditions of the episode: {error.errors()[0]['msg']}") from error


class Settings:
    """The part of a configuration that concerns simulations, without the swept values.

    Attributes:
        digest: SHA-256, in hexadecimal.
    """

    def __init__(self, config: Config) -> None:
        keys = list(leaves(config))
        physics = set(sweepable_keys(config, Effect.PHYSICS))
        self._physics = [(leaf.name, leaf.name.split("."), leaf.value) for leaf in keys if leaf.name in physics]
        heeded = {leaf.name: leaf.value for leaf in keys if leaf.key.effect in _EFFECTS_IN_DIGEST}
        # Of `task.end`, only the names count: they decide which joints are locked. The angles are in the trajectory.
        heeded["task.end"] = sorted(config.task.end)
        lines = [f"{key}={json.dumps(value)}" for key, value in sorted(heeded.items())]
        self.digest = hashlib.sha256("\n".join(lines).encode()).hexdigest()

    def conditions_of(self, trial: Config, trajectory: str) -> Conditions:
        """Make the conditions of an episode: of its trial's configuration, and of the digest of its trajectory."""
        return Conditions(build_of(trial), self.digest, self.find_replaced(trial), trajectory)

    def find_replaced(self, trial: Config) -> dict[str, float]:
        """Find the values of a trial's configuration that replace values of the collection's, by dotted key."""
        values = ((key, _get_value(trial, path), configured) for key, path, configured in self._physics)
        return {key: float(value) for key, value, configured in values if value != configured}


def _get_value(config: Config, path: Sequence[str]) -> Any:
    """Look up the value of a key; for each trial, `leaves` would take ten times as long."""
    holder: Any = config
    for part in path:
        holder = holder[part] if isinstance(holder, dict) else getattr(holder, part)
    return holder
