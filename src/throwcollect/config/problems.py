"""Turns the errors of pydantic into sentences about keys."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from pydantic import ValidationError
from pydantic_core import ErrorDetails

from throwcollect.config.section import ContradictionError, Section
from throwcollect.config.shape import root
from throwcollect.wording import find_near, join_names, suggest

_LONGEST_QUOTE = 60
_MOST_DIGITS = 9
"""Most digits of an index: Python refuses numbers of thousands of digits."""

_NO_KEYS = ("model_type", "dict_type", "union_tag_not_found")
"""Errors for values that should be sections or mappings."""

Location = tuple[str | int, ...]
"""Keys and list indices from the root of a configuration to a value."""

PARAMETERS = ("sweep", "parameters")
"""Key below which the swept keys are."""
_SWEPT_FIELDS = frozenset(("min", "max", "scale", "count", "values"))


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
    within = 1 if rest[-1] in _SWEPT_FIELDS and rest[1:] else 2 if rest[1:-1][-1:] == ("values",) else 0
    swept, field = rest[: len(rest) - within], rest[len(rest) - within :]
    return (*PARAMETERS, ".".join(swept), *field)


def read_index(holder: Any, part: str) -> str | int:
    """Read a part of a dotted key as an index if a list holds the value."""
    return int(part) if isinstance(holder, list) and part.isdecimal() and len(part) <= _MOST_DIGITS else part


def unknown_key(name: str, known: Sequence[str]) -> str:
    """Make the sentence for a key that does not exist, by the keys that would be right in its place."""
    return f"unknown key{suggest(name, known) if known else '; no keys are expected here'}"


def quote(value: Any) -> str:
    """Show a value in a message, with its beginning alone if it is long."""
    text = repr(value)
    return text if len(text) <= _LONGEST_QUOTE else f"{text[:_LONGEST_QUOTE]}…"


def find_problems(error: ValidationError, section: type[Section], values: Any) -> dict[Location, str]:
    """Make one sentence for each key that is wrong, from the errors of pydantic.

    Args:
        error: The error that pydantic raised.
        section: The section that it should have made.
        values: The values that it validated.
    """
    found: dict[Location, list[str]] = {}
    for details in error.errors(include_url=False):
        location = _locate(details, values)
        for place, sentence in _describe(details, location, section):
            sentences = found.setdefault(place, [])
            if sentence not in sentences:
                sentences.append(sentence)
    for location in [place[:length] for place in found for length in range(len(place))]:
        # A union reports the errors of every branch. The deepest is of the branch that the user meant.
        found.pop(location, None)
    return {location: "; or ".join(sentences) for location, sentences in found.items()}


def _locate(details: ErrorDetails, values: Any) -> Location:
    """Find the location of an error; those of pydantic have names of models and of branches of unions, too."""
    location: Location = ()
    here = values
    for index, part in enumerate(details["loc"]):
        inside = part in here if isinstance(here, Mapping) else isinstance(here, list) and isinstance(part, int)
        last_is_missing = details["type"] == "missing" and index == len(details["loc"]) - 1
        if inside or last_is_missing:
            location = (*location, part)
            here = here[part] if inside else None
    return location


def _describe(details: ErrorDetails, location: Location, section: type[Section]) -> Iterator[tuple[Location, str]]:
    kind, value = details["type"], details["input"]
    cause = details.get("ctx", {}).get("error")
    words: Sequence[str] = ()
    message = details["msg"].replace("Input should", "should", 1).replace("String should", "should", 1)
    if isinstance(cause, ContradictionError):
        for key, sentence in cause.sentences.items():
            # The keys are relative to the section, but only whole ones can be split.
            yield (*location, *split_key(join_key((*location, key)))[len(location) :]), sentence
        return
    if cause is not None:
        message = str(cause)
    elif kind == "extra_forbidden":
        # A key may be one of another section that is possible there.
        known = [name for name in root(section).child(*location[:-1]).keys if name != location[-1]]
        message = unknown_key(str(location[-1]), known)
    elif kind == "missing":
        message = kind
    elif kind == "union_tag_not_found" and isinstance(value, Mapping):
        # The key that chooses between sections takes a word of each.
        tag = next((each for each in ("family", "shape", "kind") if each in value), "name")
        kinds = root(section).child(*location).alternatives
        # Sections of several tasks have the same motions.
        words = list(dict.fromkeys(word for each in kinds for word in each.child(tag).choices))
        location, value = (*location, tag), value.get(tag)
        message = f"should be {join_names([repr(word) for word in words], 'or')}, got {quote(value)}"
    elif kind in _NO_KEYS:
        message = f"should be keys and values, got {quote(value)}"
    else:
        words = details.get("ctx", {}).get("expected", "").split("'")[1::2] if kind == "literal_error" else []
        message += f", got {quote(value)}"
    yield location, message + (suggest(value, words) if find_near(value, words) else "")
