"""Kinds of values that sections hold, and how a section says that its values contradict each other."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated

from pydantic import AfterValidator, Field, WithJsonSchema

_LIMBS = {"arm_left": 7, "arm_right": 7, "leg_left": 6, "leg_right": 6, "torso": 2, "head": 2}

JOINT_NAMES = (
    *(f"{limb}_{number}_joint" for limb, count in _LIMBS.items() for number in range(1, count + 1)),
    "gripper_left_joint",
    "gripper_right_joint",
)
"""Joints that a configuration may name: those of `robots.talos.JOINTS`, which this room must not import."""


class ContradictionError(ValueError):
    """Keys that are right alone and wrong together.

    Args:
        sentences: What is wrong with each key; dotted keys are relative to the section that raises.
    """

    def __init__(self, sentences: Mapping[str, str]) -> None:
        self.sentences = dict(sentences)
        super().__init__("; ".join(f"{key}: {sentence}" for key, sentence in self.sentences.items()))


class UnknownJointError(ValueError):
    """A joint that the robot does not have.

    Args:
        name: The name that was given.
    """

    def __init__(self, name: str) -> None:
        self.name = name
        super().__init__(f"Talos has no joint {name!r}")


def _known_joint(name: str) -> str:
    if name not in JOINT_NAMES:
        raise UnknownJointError(name)
    return name


Joint = Annotated[
    str, AfterValidator(_known_joint), WithJsonSchema({"type": "string", "title": "Joint", "enum": list(JOINT_NAMES)})
]
Angle = Annotated[float, Field(ge=-6.3, le=6.3, json_schema_extra={"unit": "rad"})]
Name = Annotated[str, Field(pattern=r"^[a-z0-9][a-z0-9_-]*$", max_length=64)]
