"""The base of all sections of a configuration, kinds of values that they hold, and keys for one of several sections."""

from __future__ import annotations

import ast
import inspect
import sys
from collections.abc import Callable, Iterator, Mapping
from functools import cache, reduce
from itertools import pairwise
from operator import or_
from typing import Annotated, Any

from pydantic import (
    BaseModel,
    ConfigDict,
    Discriminator,
    Field,
    GetJsonSchemaHandler,
    Tag,
    model_validator,
)
from pydantic_core import CoreSchema
from typing_extensions import Self

from throwcollect.wording import suggest


class ContradictionError(ValueError):
    """Keys that are right alone and wrong together.

    Args:
        sentences: What is wrong, by dotted key, relative to the section that raises.
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


class Section(BaseModel):
    """Base of all sections: unknown keys are errors, values never change, and keys must not contradict each other.

    Modules with sections do without ``from __future__ import annotations``: Pydantic would evaluate each annotation as
    a string, which takes a tenth of the time of importing the configuration.
    """

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False, defer_build=True)

    def __deepcopy__(self, memo: dict[int, Any] | None = None) -> Self:
        """Return the section itself, as its values never change; Pydantic copies defaults of keys that are left out."""
        return self

    def _find_contradictions(self) -> Iterator[tuple[str, str]]:
        """List the keys that are right alone and wrong together.

        Yields:
            A dotted key, relative to this section, and what is wrong with it.
        """
        yield from ()

    @model_validator(mode="after")
    def _refuse_contradictions(self) -> Self:
        if wrong := dict(self._find_contradictions()):
            raise ContradictionError(wrong)
        return self

    @classmethod
    def __get_pydantic_json_schema__(cls, core_schema: CoreSchema, handler: GetJsonSchemaHandler) -> dict[str, Any]:
        """Make the section's JSON Schema, in which the docstrings of its keys describe them.

        Pydantic's own ``use_attribute_docstrings`` would read the docstrings in every process, although few need a
        schema. That takes a third of the time of importing the configuration.
        """
        schema = handler(core_schema)
        properties = handler.resolve_ref_schema(schema).get("properties", {})
        for name, docstring in _read_docstrings(cls).items():
            properties[cls.model_fields[name].alias or name]["description"] = docstring
        return schema


def any_of(sections: Mapping[str, type[Section]], choose: Callable[[Any], Any]) -> Any:
    """Make the type of a key that holds one of several sections.

    Args:
        sections: The sections, by a name that the value of the key implies.
        choose: Finds that name in the value; anything else is an error.
    """
    kinds = list(dict.fromkeys(sections.values()))
    # Pydantic accepts a discriminator only for a union.
    if len(kinds) == 1:
        return kinds[0]

    def find_tag(value: Any) -> str | None:
        # Defaults, and sections that are validated again as a part of another, are objects already.
        if isinstance(value, Section):
            return _make_tag(type(value))
        name = choose(value)
        return _make_tag(sections[name]) if isinstance(name, str) and name in sections else None

    return Annotated[reduce(or_, [Annotated[kind, Tag(_make_tag(kind))] for kind in kinds]), Discriminator(find_tag)]


def _make_tag(section: type[Section]) -> str:
    """Name a class by its module, too, as classes of two packages may have one name."""
    return f"{section.__module__}.{section.__name__}"


def _read_docstrings(section: type[Section]) -> dict[str, str]:
    """Read the docstrings below the fields of a section and of its bases, by name of the field."""
    found: dict[str, str] = {}
    for each in reversed(section.__mro__):
        if issubclass(each, Section):
            found |= _read_docstrings_of_module(each.__module__).get(each.__qualname__, {})
    return found


@cache
def _read_docstrings_of_module(module: str) -> dict[str, dict[str, str]]:
    """Read the docstrings of fields, by class: to parse a module once is faster than to cut out each class first."""
    classes: dict[str, dict[str, str]] = {}
    for node in ast.parse(inspect.getsource(sys.modules[module])).body:
        if not isinstance(node, ast.ClassDef):
            continue
        found = classes[node.name] = {}
        for above, below in pairwise(node.body):
            match above, below:
                case ast.AnnAssign(target=ast.Name(name)), ast.Expr(ast.Constant(str(text))):
                    found[name] = inspect.cleandoc(text)
    return classes
