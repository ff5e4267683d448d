"""Which entities a client means: by name, category, tags and place."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass
from typing import Any

import re2

from throwcollect.engines.engine import Box, Vector
from throwcollect.errors import RequestError
from throwcollect.sim.entities import Entities

_LONGEST_EXPRESSION = 256


@dataclass(frozen=True)
class BoxRegion:
    """A box along the axes of the world.

    Attributes:
        lowest: One corner [m].
        highest: The opposite one [m].
    """

    lowest: Vector
    highest: Vector

    def overlaps(self, box: Box) -> bool:
        """Whether a box reaches into the region."""
        return all(
            low <= upper and lower <= high
            for lower, upper, low, high in zip(*box, self.lowest, self.highest, strict=True)
        )


@dataclass(frozen=True)
class SphereRegion:
    """A sphere.

    Attributes:
        centre: Its centre in the world [m].
        radius: Its radius [m].
    """

    centre: Vector
    radius: float

    def overlaps(self, box: Box) -> bool:
        """Whether a box reaches into the region."""
        outside = (max(lower - x, 0.0, x - upper) for x, lower, upper in zip(self.centre, *box, strict=True))
        return sum(distance * distance for distance in outside) <= self.radius**2


@dataclass(frozen=True)
class EntityFilter:
    """Conditions that an entity must meet; an empty one matches every entity.

    Attributes:
        name: POSIX extended regular expression that is found in its name; empty for any.
        categories: Its category is one of these.
        tags: It has these tags.
        needs_all_tags: Whether it must have all of them; otherwise one will do.
        region: It reaches into this region.
    """

    name: str = ""
    categories: Collection[int] = ()
    tags: Collection[str] = ()
    needs_all_tags: bool = False
    region: BoxRegion | SphereRegion | None = None

    def select(self, entities: Entities) -> list[str]:
        """Names of the entities that are meant, in order.

        Raises:
            RequestError: ``RESULT_OPERATION_FAILED`` if the regular expression is malformed.
        """
        pattern = _compile(self.name)
        return [
            name
            for name in entities.names
            if pattern.search(name) and self._fits_info(entities, name) and self._fits_place(entities, name)
        ]

    def _fits_info(self, entities: Entities, name: str) -> bool:
        info = entities.info(name)
        found = [tag in info.tags for tag in self.tags]
        has_tags = all(found) if self.needs_all_tags else any(found)
        return (not self.categories or info.category in self.categories) and (not found or has_tags)

    def _fits_place(self, entities: Entities, name: str) -> bool:
        region = self.region
        return region is None or any(region.overlaps(box) for box in entities.boxes(name))


def _compile(expression: str) -> Any:
    """Compile an expression of a client; to search a name by it takes time in proportion to the name, whatever it is.

    Raises:
        RequestError: ``RESULT_OPERATION_FAILED`` if it is malformed.
    """
    options = re2.Options()
    options.posix_syntax = True
    options.log_errors = False
    try:
        if len(expression) > _LONGEST_EXPRESSION:
            raise ValueError(f"{len(expression)} characters; at most {_LONGEST_EXPRESSION}")
        return re2.compile(expression, options)
    except (ValueError, re2.error) as error:
        # The library gives its reason as bytes.
        reason = error.args[0].decode() if isinstance(error.args[0], bytes) else error.args[0]
        message = f"filter {expression!r:.80} is no extended regular expression: {reason}"
        raise RequestError("RESULT_OPERATION_FAILED", message) from error
