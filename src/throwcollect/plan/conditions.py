"""The conditions that an episode was simulated under, which are worked out twice and compared.

The coordinator works out the conditions of a trial from the plan, and the simulation from what it has really used. An
episode whose conditions differ does not belong to the plan, for whatever reason.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Sequence
from typing import Any

from throwcollect.build import build_digest
from throwcollect.config.key import Effect
from throwcollect.config.schema import Config
from throwcollect.config.values import leaves, sweepable_keys
from throwcollect.plan.trials import Values

_EFFECTS_IN_DIGEST = (Effect.PHYSICS, Effect.ENCODING)


_DIFFERENCES = (
    "its sources, its physics engine or its robot model are not those of the coordinator",
    "its configuration is another one",
    "its values are not those of the plan",
    "its controllers were given another trajectory",
)
"""What it means if one of the lines of conditions is another one."""


def explain_difference(used: str, expected: str) -> str | None:
    """Explain why an episode under these conditions is not the one that was asked for; None if it is."""
    if used == expected:
        return None
    lines = zip(_DIFFERENCES, used.split("\n"), expected.split("\n"), strict=False)
    return "; ".join(text for text, one, other in lines if one != other) or "it has no conditions"


def build_of(config: Config) -> str:
    """Digest of what computes the episodes of a configuration here (`build.build_digest`)."""
    policy = (config.task.policy.use,) if config.task.policy else ()
    return build_digest(config.sim.engine, config.robot.name, config.tool.name, config.task.name, *policy)


class Settings:
    """The part of a configuration that concerns simulations, without the swept values.

    Attributes:
        digest: SHA-256, in hexadecimal.
    """

    def __init__(self, config: Config) -> None:
        self._config = config
        keys = list(leaves(config))
        swept = set(sweepable_keys(config))
        self._configured = {leaf.name: leaf.value for leaf in keys if leaf.name in swept}
        heeded = {leaf.name: leaf.value for leaf in keys if leaf.key.effect in _EFFECTS_IN_DIGEST}
        # Of `task.end`, only the names count: they decide which joints are locked. The angles are in the trajectory.
        heeded["task.end"] = sorted(config.task.end)
        lines = [f"{key}={json.dumps(value)}" for key, value in sorted(heeded.items())]
        self.digest = hashlib.sha256("\n".join(lines).encode()).hexdigest()

    def conditions_of(self, values: Values, trajectory: str) -> str:
        """Write the conditions of an episode, by its trial's values and the digest of its trajectory, in lines.

        They are digests of what computes (`build_of`) and of the collection's settings, the values of the trial that
        differ from these in JSON, and the trajectory that the controllers were given; empty if there was no lease.
        """
        replaced = {key: float(value) for key, value in values.items() if value != self._configured[key]}
        lines = build_of(self._config), self.digest, json.dumps(replaced, sort_keys=True), trajectory
        return "\n".join(lines)

    def read_values(self, trial: Config) -> Values:
        """Read from a trial's configuration the values of all sections that differ from the collection's."""
        changed = {name for name, section in trial.__dict__.items() if section is not getattr(self._config, name)}
        paths = ((key, key.split(".")) for key in self._configured)
        return {key: _get_value(trial, path) for key, path in paths if path[0] in changed}


def _get_value(config: Config, path: Sequence[str]) -> Any:
    """Look up the value of a key; for each trial, `leaves` would take ten times as long."""
    holder: Any = config
    for part in path:
        if isinstance(holder, list):
            holder = holder[int(part)]
        else:
            holder = holder[part] if isinstance(holder, dict) else getattr(holder, part)
    return holder
