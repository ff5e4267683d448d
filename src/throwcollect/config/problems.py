"""Turns the errors of pydantic into sentences about keys."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from difflib import get_close_matches
from typing import Any

from pydantic import ValidationError
from pydantic_core import ErrorDetails

from throwcollect.config.kinds import ContradictionError, UnknownJointError
from throwcollect.config.shape import ValueShape, shape_of

_RANGE_ERRORS = ("greater_than", "greater_than_equal", "less_than", "less_than_equal")
_LONGEST_QUOTE = 60
_LONGEST_WORD = 200
"""A longer text is not a misspelt word, so that no similar word is looked for."""

MOST_EXAMINED = 200
"""Number of errors of pydantic that are put into words; the others are only counted."""

Location = tuple[str | int, ...]
"""Keys and list indices from the root of a configuration to a value."""

_ENGINE: Location = ("sim", "engine")
_MEMBERS: tuple[Location, ...] = (("robot", "name"), ("tool", "name"), _ENGINE, ("task", "name"))
"""Keys that name a member of a family, which another package may bring."""
_NOT_INSTALLED = "; no package that is installed brings it"


@dataclass(frozen=True)
class KeyProblem:
    """Something that is wrong with one key.

    Attributes:
        location: The key, which need not exist.
        sentence: Says what is wrong, which value was given and which would be right.
        unknown: Whether the key itself is wrong, and not its value.
        meant: Name of the key that the user probably meant by an unknown one: the most similar, or the only one that
            the section has; empty if there is none.
    """

    location: Location
    sentence: str
    unknown: bool = False
    meant: str = ""

    @property
    def key(self) -> str:
        """The dotted key."""
        return join_key(self.location)


def join_key(location: Location) -> str:
    """Join the parts of a location with dots."""
    return ".".join(map(str, location))


def unknown_key(name: str, known: list[str]) -> str:
    """Make the sentence for a key that does not exist, by the keys that would be right in its place."""
    if meant := _find_nearest(name, known):
        return f"unknown key{_did_you_mean(meant)}"
    return "unknown key; " + (f"known keys here: {', '.join(known)}" if known else "no keys are expected here")


def unknown_joint(name: str, robot: str, joints: Sequence[str]) -> str:
    """Make the sentence for a name that is no joint of a robot, by the robot's joints."""
    return _refuse_joint(name, robot, _find_nearest(name, joints))


def quote(value: Any) -> str:
    """Show a value in a message as its author would recognise it."""
    if isinstance(value, str):
        return repr(value if len(value) <= _LONGEST_QUOTE else value[:_LONGEST_QUOTE] + "…")
    if isinstance(value, Mapping):
        return "keys and values" if value else "no keys"
    if isinstance(value, list):
        return "a list" if value else "an empty list"
    if value is None:
        return "nothing"
    return str(value).lower() if isinstance(value, bool) else str(value)


def findings(
    error: ValidationError, values: Any, *, above: Location = (), shape: ValueShape | None = None
) -> list[KeyProblem]:
    """Put the first 200 errors of pydantic into words: one finding for each key, unknown keys first.

    Args:
        error: The error that pydantic raised.
        values: The values that it validated.
        above: Location of these values in a configuration.
        shape: Shape that these values should have; None for the one that a configuration has there.
    """
    expected = shape or shape_of(above)
    found: dict[Location, KeyProblem] = {}
    for details in error.errors(include_url=False)[:MOST_EXAMINED]:
        for finding in _describe_error(details, values, above, expected):
            # A union reports an error for each alternative, and the first sentence names all of them.
            found.setdefault(finding.location, finding)
    for location in [place[:length] for place in found for length in range(len(place))]:
        # A union reports the errors of every branch. The deepest is of the branch that the user meant.
        found.pop(location, None)
    unknown = [finding for finding in found.values() if finding.unknown]
    # A misspelt or mistaken key is also missing under its right name, which is no second mistake.
    meant = {(*finding.location[:-1], finding.meant) for finding in unknown}
    rest = [finding for finding in found.values() if not finding.unknown and finding.location not in meant]
    return [*unknown, *rest]


def _describe_error(details: ErrorDetails, values: Any, above: Location, expected: ValueShape) -> Iterator[KeyProblem]:
    location, shape, section = _locate(details, values, above, expected)
    kind, value = details["type"], details["input"]
    cause = details.get("ctx", {}).get("error")
    is_key = details["loc"][-1:] == ("[key]",)
    if kind == "extra_forbidden":
        name, known = str(location[-1]), list(section.keys)
        refused = section.refused.get(name)
        # If a section has a single key, the user means that key, whatever they wrote.
        only = known[0] if len(known) == 1 else ""
        if name.isdecimal() and value is None:
            # YAML takes what follows a comma for the next key.
            refused = "unknown key; if it is the end of a number, decimals are written with a point, as in 1.5"
        if location[:-1] == ("sweep",) and "." in name:
            # The level between is the one that is forgotten most often.
            refused = "unknown key; keys that vary belong below sweep.parameters"
        meant = "" if refused else _find_nearest(name, known) or only
        yield KeyProblem(location, refused or unknown_key(name, known), unknown=True, meant=meant)
    elif isinstance(cause, ContradictionError):
        for key, sentence in cause.sentences.items():
            yield KeyProblem((*location, *_split(key)), sentence)
    elif isinstance(cause, UnknownJointError):
        meant = _find_nearest(cause.name, cause.joints)
        sentence = _refuse_joint(cause.name, cause.robot, meant)
        yield KeyProblem(location, sentence, unknown=is_key, meant=meant)
    elif cause is not None:
        yield KeyProblem(location, str(cause), unknown=is_key)
    elif kind == "missing":
        yield KeyProblem(location, f"missing; should be {shape}")
    elif kind == "union_tag_not_found" and isinstance(value, Mapping):
        tag = "family" if "family" in value else "name"
        choices = [word for each in shape.alternatives for word in each.child(tag).choices]
        words = " or ".join(f"'{each}'" for each in choices)
        no_match = _NOT_INSTALLED if (*location, tag) in _MEMBERS else ""
        yield KeyProblem((*location, tag), _write_expectation(words, value[tag], choices, no_match=no_match))
    else:
        no_match = _NOT_INSTALLED if location in _MEMBERS else ""
        if location == _ENGINE and value == "auto":
            no_match = "; none is chosen automatically, as the same file would give other throws on another machine"
        sentence = _write_expectation(str(shape), value, shape.choices, no_match=no_match)
        yield KeyProblem(location, sentence + _explain_radians(kind, shape, value))


def _refuse_joint(name: str, robot: str, meant: str) -> str:
    return f"{robot} has no joint {quote(name)}{_did_you_mean(meant)}"


def _write_expectation(words: str, value: Any, choices: list[str], *, no_match: str = "") -> str:
    """Say what would be right, and which choice the user meant; if none is like the value, append `no_match`."""
    return f"should be {words}, got {quote(value)}{_did_you_mean(_find_nearest(value, choices)) or no_match}"


def _find_nearest(value: Any, choices: Sequence[str]) -> str:
    """Find the choice that is most like a value; an empty text if none is."""
    looks_like_a_word = isinstance(value, str) and len(value) <= _LONGEST_WORD
    return next(iter(get_close_matches(value, choices, 1)), "") if looks_like_a_word else ""


def _did_you_mean(choice: str) -> str:
    return f"; did you mean '{choice}'?" if choice else ""


def _explain_radians(kind: str, shape: ValueShape, value: Any) -> str:
    if kind not in _RANGE_ERRORS or shape.unit != "rad":
        return ""
    return f"; angles are in radians: {value:g} degrees are {math.radians(value):.4f}"


def _locate(
    details: ErrorDetails, values: Any, above: Location, expected: ValueShape
) -> tuple[Location, ValueShape, ValueShape]:
    """Find the location of an error, the shape of the value there, and the shape of the section that holds it.

    The locations of pydantic also have names of models and of branches of unions, which are left out.
    """
    location, shape, here = list(above), expected, values
    section = shape
    parts = details["loc"]
    for index, part in enumerate(parts):
        inside = part in here if isinstance(here, Mapping) else isinstance(here, list) and isinstance(part, int)
        last_is_missing = details["type"] == "missing" and index == len(parts) - 1
        if inside or last_is_missing:
            location.append(part)
            section, shape = shape, shape.child(part)
            here = here[part] if inside else None
        else:
            # The branch of a union is named by module and class; a title is the class alone.
            title = str(part).rpartition(".")[2]
            shape = next((each for each in shape.alternatives if each.node.get("title") == title), shape)
    return tuple(location), shape, section


def _split(key: str) -> Location:
    """Split a dotted key of a contradiction, but not the key of a swept parameter in it, which has dots itself."""
    head, found, rest = key.partition("parameters.")
    if found and not head:
        name, _, field = rest.rpartition(".")
        return ("parameters", name, field)
    return tuple(key.split("."))
