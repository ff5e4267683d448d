"""The annotation of configuration keys: their effect, and who or what may set them or vary them.

It is written on the field, and nowhere else. The annotation of a section holds for all keys below it that have none of
their own::

    class BallConfig(Section):
        mass_kg: Annotated[float, Field(gt=0)] = 0.045

    class Config(Section):
        ball: Annotated[BallConfig, Key(Effect.PHYSICS, swept=True)] = BallConfig()
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from enum import Enum
from functools import cache

from throwcollect.config.section import Section


class Effect(Enum):
    """What the value of a key has an effect on."""

    PHYSICS = "physics"
    """The samples of a trial, which the simulation computes."""
    TASK = "task"
    """The joint trajectories that simulations are sent, and the outcomes of episodes, which the coordinator judges."""
    PLAN = "plan"
    """Which trials there are: it acts through the values and the seed of each trial."""
    ENCODING = "encoding"
    """How a simulation packs the samples of an episode; the samples stay the same."""
    FILES = "files"
    """How episodes are cut into files; the episodes stay the same."""
    APPEARANCE = "appearance"
    """What clients of a running simulation see; samples and files stay the same."""
    RUN = "run"
    """How and where a collection is run; the dataset stays the same."""


@dataclass(frozen=True)
class Key:
    """Annotation of a field of a section; an attribute that is None has its value from the section's annotation.

    Attributes:
        effect: What the value has an effect on.
        swept: Whether a sweep may vary the value from trial to trial, if it is a number that may have decimals.
        operator: Whether only the operator of a server sets the value, as it names files or resources of its machine.
    """

    effect: Effect | None = None
    swept: bool | None = None
    operator: bool | None = None

    @property
    def determines_samples(self) -> bool:
        """Whether the value may change the samples of a trial."""
        return self.effect in (Effect.PHYSICS, Effect.TASK)


@cache
def key_of_field(section: type[Section], name: str) -> Key:
    """Return the annotation of a field; an empty one if it has none."""
    return next((each for each in section.model_fields[name].metadata if isinstance(each, Key)), Key())


@cache
def overlay(above: Key, section: type[Section], name: str) -> Key:
    """Combine the annotation of a section with the annotation of one of its fields, which wins where it is not None."""
    own = {name: value for name, value in vars(key_of_field(section, name)).items() if value is not None}
    return replace(above, **own)
