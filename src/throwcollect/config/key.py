"""What the product has to know of a configuration key besides its type: it stands on the field, and nowhere else.

A section says it for all keys below it, and a key may say otherwise for itself::

    class BallConfig(Section):
        mass_kg: Annotated[float, Field(gt=0)] = 0.045

    class Config(Section):
        ball: Annotated[BallConfig, Key(Effect.PHYSICS, swept=True)] = BallConfig()
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from enum import Enum

from throwcollect.config.section import Section


class Effect(Enum):
    """What the value of a key has an effect on."""

    PHYSICS = "physics"
    """The samples of a trial: the simulation heeds it."""
    TASK = "task"
    """The joint trajectories that simulations are sent, and how episodes are judged: the coordinator heeds it."""
    PLAN = "plan"
    """Which trials there are: it acts through the values and the seed of each trial."""
    ENCODING = "encoding"
    """How a simulation packs the samples of an episode; the samples stay the same."""
    FILES = "files"
    """How episodes are cut into files; the episodes stay the same."""
    APPEARANCE = "appearance"
    """How a simulation looks from outside while it runs; samples and files stay the same."""
    RUN = "run"
    """How and where a collection is run; the dataset stays the same."""


@dataclass(frozen=True)
class Key:
    """Annotation of a field of a section; what is None holds as for the section that the field is in.

    Attributes:
        effect: What the value has an effect on.
        swept: Whether a sweep may vary the value from trial to trial, if it is a number.
        later: Whether the key came after datasets had been published. It takes part in digests where it differs from
            its default, so that older digests hold.
    """

    effect: Effect | None = None
    swept: bool | None = None
    later: bool | None = None

    @property
    def determines_samples(self) -> bool:
        """Whether the value may change the samples of a trial."""
        return self.effect in (Effect.PHYSICS, Effect.TASK)

    def overlay(self, key: Key) -> Key:
        """What holds for a key in a section that this one describes: its own word, or else that of the section."""
        own = {name: value for name, value in vars(key).items() if value is not None}
        return replace(self, **own)


def key_of_field(section: type[Section], name: str) -> Key:
    """Return what a field says of itself; an empty `Key` if it says nothing."""
    return next((each for each in section.model_fields[name].metadata if isinstance(each, Key)), Key())
