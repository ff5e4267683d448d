"""Kinds of values that sections hold, and the errors that validators of sections raise."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any

from pydantic import BeforeValidator, Field

from throwcollect.wording import suggest


class ContradictionError(ValueError):
    """Keys that are right alone and wrong together.

    Args:
        sentences: Sentence that says what is wrong, by dotted key, relative to the section that raises.
    """

    def __init__(self, sentences: Mapping[str, str]) -> None:
        self.sentences = dict(sentences)
        super().__init__("; ".join(f"{key}: {sentence}" for key, sentence in self.sentences.items()))


def unknown_joint(name: str, robot: Any) -> str:
    """Make the sentence for a name that is no joint of a robot."""
    return f"{robot.title} has no joint {name!r}{suggest(name, robot.joints)}"


Joint = str
"""Name of a joint; `Config` checks that the robot has it, as any URDF may name other joints."""
Angle = Annotated[float, Field(ge=-6.3, le=6.3, json_schema_extra={"unit": "rad"})]
Name = Annotated[str, Field(pattern=r"^[a-z0-9][a-z0-9_-]*$", max_length=64)]


def _make_text(value: object) -> object:
    # `isinstance` would also take `true`, which is an `int` in Python.
    return str(value) if type(value) is int else value


NUMBER_AS_TEXT = BeforeValidator(_make_text)
"""Lets a text be a single whole number without quotes, which YAML reads as a number: the core 0, or 90 minutes."""
