"""Turns the errors of pydantic into sentences about keys."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from pydantic import ValidationError
from pydantic_core import ErrorDetails

from throwcollect.config.kinds import ContradictionError, UnknownJointError, unknown_joint
from throwcollect.config.shape import ValueShape, shape_of, unit_of_key
from throwcollect.units import DECIMALS, explain_number
from throwcollect.wording import find_near, suggest

_LONGEST_QUOTE = 60

MOST_EXAMINED = 200
"""Number of errors of pydantic that are put into words; the others are only counted."""

Location = tuple[str | int, ...]
"""Keys and list indices from the root of a configuration to a value."""

PARAMETERS = ("sweep", "parameters")
"""Key below which the swept keys are."""
SWEPT_FIELDS = frozenset(("min", "max", "scale", "count", "values"))
_ENGINE: Location = ("sim", "engine")
_MEMBERS: tuple[Location, ...] = (("robot", "name"), ("tool", "name"), _ENGINE, ("task", "name"))
"""Keys that name a member of a family, which another package may bring."""
_NOT_INSTALLED = "; no package that is installed brings it; CONTRIBUTING.md describes how to add one"
_PAGE = "docs/configuration.md"


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


def split_key(key: str) -> tuple[str, ...]:
    """Split a dotted key, but not the key of a swept parameter in it, which has dots itself."""
    parts = tuple(key.split("."))
    if parts[:2] != PARAMETERS or len(parts) < 3:
        return parts
    rest = parts[2:]
    # The first part always belongs to the swept key, even if it has the name of a field, such as `min`.
    within = 1 if rest[-1] in SWEPT_FIELDS and rest[1:] else 2 if rest[1:-1][-1:] == ("values",) else 0
    swept, field = rest[: len(rest) - within], rest[len(rest) - within :]
    return (*PARAMETERS, ".".join(swept), *field)


def unknown_key(name: str, known: Sequence[str], *, page: str = _PAGE) -> str:
    """Make the sentence for a key that does not exist, by the keys that would be right in its place."""
    return f"unknown key{suggest(name, known, page) if known else '; no keys are expected here'}"


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
    error: ValidationError,
    values: Any,
    *,
    above: Location = (),
    shape: ValueShape | None = None,
    page: str = _PAGE,
) -> list[KeyProblem]:
    """Put the first 200 errors of pydantic into words: one finding for each key, unknown keys first.

    Args:
        error: The error that pydantic raised.
        values: The values that it validated.
        above: Location of these values in a configuration.
        shape: Shape that these values should have; None for the one that a configuration has there.
        page: Page that lists the keys.
    """
    expected = shape or shape_of(above)
    found: dict[Location, KeyProblem] = {}
    for details in error.errors(include_url=False)[:MOST_EXAMINED]:
        for finding in _describe_error(details, values, above, expected, page):
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


def _describe_error(
    details: ErrorDetails, values: Any, above: Location, expected: ValueShape, page: str
) -> Iterator[KeyProblem]:
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
            refused = f"unknown key; if it is the end of a number, {DECIMALS}"
        if location[:-1] == ("sweep",) and "." in name:
            # The level between is the one that is forgotten most often.
            refused = "unknown key; keys that vary belong below sweep.parameters"
        meant = "" if refused else next(iter(find_near(name, known)), only)
        sentence = refused or unknown_key(name, known, page=page)
        if not meant and not refused and (*location[:-1], "name") in _MEMBERS:
            # What a robot or a tool is cannot be written in a configuration, as many expect of a URDF.
            sentence += f"; CONTRIBUTING.md describes how to add a {location[0]}"
        yield KeyProblem(location, sentence, unknown=True, meant=meant)
    elif isinstance(cause, ContradictionError):
        for key, sentence in cause.sentences.items():
            # The keys are relative to the section, but only whole ones can be split.
            yield KeyProblem((*location, *split_key(join_key((*location, key)))[len(location) :]), sentence)
    elif isinstance(cause, UnknownJointError):
        yield KeyProblem(location, unknown_joint(cause.name, cause.robot), unknown=is_key)
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
        no_match = f"; {page} explains them" if len(shape.choices) > 2 else ""
        if location in _MEMBERS:
            no_match = _NOT_INSTALLED
        if location == _ENGINE and value == "auto":
            no_match = "; none is chosen automatically, as the same file would give other throws on another machine"
        if value is None and location and shape.has_keys:
            no_match = "; write keys into it, or leave it out"
        # Bounds and values of a swept key have its unit.
        is_swept = location[:2] == PARAMETERS and location[3:4] in (("min",), ("max",), ("values",))
        unit = unit_of_key(str(location[2])) if is_swept else shape.unit
        sentence = _write_expectation(str(shape), value, shape.choices, no_match=no_match)
        yield KeyProblem(location, sentence + explain_number(value, unit))


def _write_expectation(words: str, value: Any, choices: Sequence[str], *, no_match: str = "") -> str:
    """Say what would be right, and which choice the user meant; if none is like the value, append `no_match`."""
    meant = suggest(value, choices) if find_near(value, choices) else no_match
    return f"should be {words}, got {quote(value)}{meant}"


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
