"""Checks values that other packages make against the types that our own code declares for them."""

from __future__ import annotations

import reprlib
from functools import lru_cache
from typing import TYPE_CHECKING, Any, get_type_hints

if TYPE_CHECKING:
    from pydantic import TypeAdapter


def check_type(name: str, value: object, declared: Any) -> None:
    """Make sure that a value is of the type that is declared for it, and so is all that it contains.

    Fields of dataclasses and items of containers are checked, too. Nothing is converted, and a float has to be finite.

    Args:
        name: Name of the value in messages; empty if the names of its fields are enough.
        value: The value.
        declared: The type.
    """
    # Most processes use no other package, and need not spend the time of this import.
    from pydantic import ValidationError

    try:
        _make_adapter(declared).validate_python((value,))
    except ValidationError as error:
        first = error.errors(include_url=False)[0]
        place = ".".join(map(str, (*([name] if name else ()), *first["loc"][1:])))
        should = first["msg"].removeprefix("Value error, ").removeprefix("Input ")
        raise TypeError(f"{place}: {should}, is {reprlib.repr(first['input'])}") from error


def check_properties(value: object, kind: type) -> None:
    """Make sure that the properties that a kind of parts declares are of their types in a value of that kind."""
    for name, described in vars(kind).items():
        if isinstance(described, property):
            check_type(name, getattr(value, name), get_type_hints(described.fget, include_extras=True)["return"])


@lru_cache
def _make_adapter(declared: Any) -> TypeAdapter[Any]:
    from pydantic import ConfigDict, TypeAdapter

    config = ConfigDict(strict=True, arbitrary_types_allowed=True, allow_inf_nan=False, revalidate_instances="always")
    # Dataclasses take the configuration only from what they are in.
    return TypeAdapter(tuple[declared], config=config)
