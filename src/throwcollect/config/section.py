"""What all sections of a configuration have in common."""

from __future__ import annotations

import ast
import inspect
import sys
from functools import cache
from itertools import pairwise
from typing import Any

from pydantic import BaseModel, ConfigDict, GetJsonSchemaHandler
from pydantic_core import CoreSchema


class Section(BaseModel):
    """Base of all sections: unknown keys are errors, values never change."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)

    @classmethod
    def __get_pydantic_json_schema__(cls, core_schema: CoreSchema, handler: GetJsonSchemaHandler) -> dict[str, Any]:
        """The section's JSON Schema, in which the docstrings of its keys describe them.

        Pydantic's own ``use_attribute_docstrings`` reads them in every process, of which few ask for a schema: a
        third of the time that importing the configuration takes.
        """
        schema = handler(core_schema)
        properties = handler.resolve_ref_schema(schema).get("properties", {})
        for name, docstring in _read_docstrings(cls).items():
            properties[name]["description"] = docstring
        return schema


def _read_docstrings(section: type[Section]) -> dict[str, str]:
    """The docstrings that stand below the fields of a section and of its bases, by name of the field."""
    found: dict[str, str] = {}
    for each in reversed(section.__mro__):
        if issubclass(each, Section):
            found |= _read_docstrings_of_module(each.__module__).get(each.__qualname__, {})
    return found


@cache
def _read_docstrings_of_module(module: str) -> dict[str, dict[str, str]]:
    """The docstrings of fields, by class: a module is parsed once, as cutting each class out of it takes longer."""
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
