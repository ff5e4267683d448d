"""Finds entities by name, category, tags and place, as a client asks (simulation_interfaces/msg/EntityFilters)."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import re2

from throwcollect.engines.engine import Box
from throwcollect.errors import RequestError
from throwcollect.ros.msg import Bounds, EntityFilters, TagsFilter
from throwcollect.sim.entities import Entities

_LONGEST_EXPRESSION = 256
_CORNERS = 2
_MOST_WANTED = 1000
"""Largest number of categories, and of tags, in one filter."""


def select(entities: Entities, filters: EntityFilters) -> list[str]:
    """List the entities that meet every condition of a filter, in order; a condition that is empty always holds."""
    tags = filters.tags
    if len(tags.tags) > _MOST_WANTED or len(filters.categories) > _MOST_WANTED:
        raise _senseless(f"more than {_MOST_WANTED} tags or categories")
    if tags.filter_mode not in (TagsFilter.FILTER_MODE_ANY, TagsFilter.FILTER_MODE_ALL):
        raise _senseless(f"no tags filter mode {tags.filter_mode}")
    has_enough = all if tags.filter_mode == TagsFilter.FILTER_MODE_ALL else any
    categories = {int(category.category) for category in filters.categories}
    overlaps = _make_region_test(filters.bounds)
    pattern = _compile(filters.filter)

    def fits(name: str) -> bool:
        info = entities.info(name)
        return (
            bool(pattern.search(name))
            and (not categories or info.category in categories)
            and (not tags.tags or has_enough(tag in info.tags for tag in tags.tags))
            and (overlaps is None or any(overlaps(box) for box in entities.boxes(name)))
        )

    return [name for name in entities.names if fits(name)]


def _make_region_test(bounds: Bounds) -> Callable[[Box], bool] | None:
    """Make a test of whether a box along the axes of the world reaches into a region; None if there are no bounds."""
    if bounds.type == Bounds.TYPE_EMPTY:
        return None
    if bounds.type not in (Bounds.TYPE_BOX, Bounds.TYPE_SPHERE):
        message = f"bounds of type {bounds.type}; boxes and spheres are supported"
        raise RequestError("RESULT_FEATURE_UNSUPPORTED", message)
    if len(bounds.points) != _CORNERS:
        raise _senseless(f"bounds with {len(bounds.points)} points; a box and a sphere have {_CORNERS}")
    # simulation_interfaces/msg/Bounds has the upper corner of a box first, and the radius of a sphere in x of its
    # second point.
    first, second = ((float(point.x), float(point.y), float(point.z)) for point in bounds.points)
    if bounds.type == Bounds.TYPE_SPHERE:
        radius = second[0]
        if not radius >= 0:
            raise _senseless(f"a sphere of radius {radius:g} m")
        return lambda box: math.dist(np.clip(first, *box), first) <= radius
    if not all(low <= high for high, low in zip(first, second, strict=True)):
        raise _senseless(f"a box whose upper corner {first} is not above its lower one {second}")
    return lambda box: all(
        low <= upper and lower <= high for lower, upper, low, high in zip(*box, second, first, strict=True)
    )


def _compile(expression: str) -> Any:
    """Compile a POSIX extended regular expression of a client; searching takes time in proportion to the name."""
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
        raise _senseless(f"filter {expression!r:.80} is no extended regular expression: {reason}") from error


def _senseless(message: str) -> RequestError:
    return RequestError("RESULT_OPERATION_FAILED", message)
