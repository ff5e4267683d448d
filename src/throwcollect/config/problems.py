"""From what pydantic finds to sentences about keys."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from difflib import get_close_matches
from typing import Any

from pydantic import ValidationError
from pydantic_core import ErrorDetails

from throwcollect.config.kinds import ContradictionError, UnknownJointError
from throwcollect.config.shape import Shape, shape_of

_RANGE_ERRORS = ("greater_than", "greater_than_equal", "less_than", "less_than_equal")
_LONGEST_QUOTE = 60
_LONGEST_WORD = 200
"""What is longer is no word that was misspelt."""

MOST_EXAMINED = 200
"""What pydantic finds beyond that is counted and not put into words, as nobody would read them."""

Location = tuple[str | int, ...]
"""Keys and list indices from the root of a configuration to a value."""

_MEMBERS: tuple[Location, ...] = (("robot", "name"), ("tool", "name"), ("sim", "engine"), ("task", "name"))
"""Where a member of a family is named, which a package may bring."""


@dataclass(frozen=True)
class Finding:
    """Something that is wrong at one place.

    Attributes:
        location: Where; need not exist.
        sentence: What was wrong, what was got and what would be right.
        unknown: Whether the key itself is wrong, not its value.
    """

    location: Location
    sentence: str
    unknown: bool = False

    @property
    def key(self) -> str:
        """Dotted key of the place."""
        return join_key(self.location)


def join_key(location: Location) -> str:
    """Dotted key of a place."""
    return ".".join(map(str, location))


def unknown_key(name: str, known: list[str]) -> str:
    """Sentence for a key that does not exist.

    Args:
        name: The key.
        known: All keys that would be right in its place.
    """
    if meant := _did_you_mean(name, known):
        return f"unknown key{meant}"
    return "unknown key; " + (f"known keys here: {', '.join(known)}" if known else "no keys are expected here")


def quote(value: Any) -> str:
    """A value as its author would know it again."""
    if isinstance(value, str):
        return repr(value if len(value) <= _LONGEST_QUOTE else value[:_LONGEST_QUOTE] + "…")
    if isinstance(value, Mapping):
        return "keys and values"
    if isinstance(value, list):
        return "a list" if value else "an empty list"
    if value is None:
        return "nothing"
    return str(value).lower() if isinstance(value, bool) else str(value)


def findings(error: ValidationError, values: Any, *, above: Location = (), shape: Shape | None = None) -> list[Finding]:
    """What pydantic found, or the first 200 of it: one finding a key, unknown keys first.

    Args:
        error: What pydantic raised.
        values: The values that it was given.
        above: Where in a configuration these values are.
        shape: What these values should be; None for what a configuration has there.
    """
    expected = shape or shape_of(above)
    found: dict[Location, Finding] = {}
    for details in error.errors(include_url=False)[:MOST_EXAMINED]:
        for finding in _findings(details, values, above, expected):
            # A union reports once for each alternative; the sentence speaks of all of them anyway.
            found.setdefault(finding.location, finding)
    for location in [place[:length] for place in found for length in range(len(place))]:
        # A union reports every branch. Keep the deepest error: it is of the branch that the user meant.
        found.pop(location, None)
    unknown = [finding for finding in found.values() if finding.unknown]
    meant = {(*finding.location[:-1], _nearest(finding)) for finding in unknown}
    rest = [finding for finding in found.values() if not finding.unknown and finding.location not in meant]
    return [*unknown, *rest]


def _nearest(finding: Finding) -> str:
    return finding.sentence.partition("did you mean '")[2].partition("'")[0]


def _findings(details: ErrorDetails, values: Any, above: Location, expected: Shape) -> Iterator[Finding]:
    location, shape = _locate(details, values, above, expected)
    kind, value = details["type"], details["input"]
    cause = details.get("ctx", {}).get("error")
    is_key = details["loc"][-1:] == ("[key]",)
    if kind == "extra_forbidden":
        section, name = _section(details, values, above, expected), str(location[-1])
        yield Finding(location, section.refused.get(name) or unknown_key(name, list(section.keys)), unknown=True)
    elif isinstance(cause, ContradictionError):
        for key, sentence in cause.sentences.items():
            yield Finding((*location, *_split(key)), sentence)
    elif isinstance(cause, UnknownJointError):
        meant = _did_you_mean(cause.name, cause.joints)
        yield Finding(location, f"{cause.robot} has no joint {quote(cause.name)}{meant}", unknown=is_key)
    elif cause is not None:
        yield Finding(location, str(cause), unknown=is_key)
    elif kind == "missing":
        yield Finding(location, f"missing; should be {shape}")
    elif kind == "union_tag_not_found" and isinstance(value, Mapping):
        tag = "family" if "family" in value else "name"
        choices = [word for each in shape.alternatives for word in each.child(tag).choices]
        words = " or ".join(f"'{each}'" for each in choices)
        yield Finding((*location, tag), _should_be(words, value[tag], choices))
    else:
        strange = "; no package that is installed brings it" if location in _MEMBERS else ""
        sentence = _should_be(str(shape), value, shape.choices, strange=strange)
        yield Finding(location, sentence + _radians(kind, shape, value))


def _should_be(words: str, value: Any, choices: list[str], *, strange: str = "") -> str:
    """Say what would be right, and which choice was meant; `strange` is what is said if none is like the value."""
    return f"should be {words}, got {quote(value)}{_did_you_mean(value, choices) or strange}"


def _did_you_mean(value: Any, choices: Sequence[str]) -> str:
    looks_like_a_word = isinstance(value, str) and len(value) <= _LONGEST_WORD
    near = get_close_matches(value, choices, 1) if looks_like_a_word else []
    return f"; did you mean '{near[0]}'?" if near else ""


def _radians(kind: str, shape: Shape, value: Any) -> str:
    if kind not in _RANGE_ERRORS or shape.unit != "rad":
        return ""
    return f"; angles are in radians: {value:g} degrees are {math.radians(value):.4f}"


def _locate(details: ErrorDetails, values: Any, above: Location, expected: Shape) -> tuple[Location, Shape]:
    """Where an error is, without the names of models and unions that pydantic mixes into its locations."""
    location, shape, here = list(above), expected, values
    parts = details["loc"]
    for index, part in enumerate(parts):
        inside = part in here if isinstance(here, Mapping) else isinstance(here, list) and isinstance(part, int)
        last_is_missing = details["type"] == "missing" and index == len(parts) - 1
        if inside or last_is_missing:
            location.append(part)
            shape = shape.child(part)
            here = here[part] if inside else None
        else:
            shape = next((each for each in shape.alternatives if each.node.get("title") == part), shape)
    return tuple(location), shape


def _section(details: ErrorDetails, values: Any, above: Location, expected: Shape) -> Shape:
    container = ErrorDetails(type="section", loc=details["loc"][:-1], msg="", input=None)
    return _locate(container, values, above, expected)[1]


def _split(key: str) -> Location:
    """Parts of a dotted key of a contradiction; the dots in the key of a swept parameter do not part it."""
    head, found, rest = key.partition("parameters.")
    if found and not head:
        name, _, field = rest.rpartition(".")
        return ("parameters", name, field)
    return tuple(key.split("."))
