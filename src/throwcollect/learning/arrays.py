"""Parts of the JSON files of models: objects that never change, and arrays of numbers, which are nested lists there."""

from __future__ import annotations

from typing import Annotated, Any

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, Field, FiniteFloat, GetPydanticSchema
from pydantic_core import core_schema

Array = NDArray[np.float64]


class ModelEntry(BaseModel):
    """Base of all objects in these files: unknown keys are errors."""

    model_config = ConfigDict(extra="forbid", frozen=True)


def _read_lists(lists: Any, dtype: type[np.generic]) -> GetPydanticSchema:
    """Read lists of a JSON file as an array, and write the array as lists; arrays from Python code stay as they are."""
    return GetPydanticSchema(
        lambda _, handler: core_schema.json_or_python_schema(
            core_schema.no_info_after_validator_function(lambda rows: np.array(rows, dtype), handler(lists)),
            core_schema.is_instance_schema(np.ndarray),
            serialization=core_schema.plain_serializer_function_ser_schema(np.ndarray.tolist),
        )
    )


Vector = Annotated[Array, _read_lists(list[FiniteFloat], np.float64)]
Matrix = Annotated[Array, _read_lists(list[list[FiniteFloat]], np.float64)]
Exponents = Annotated[NDArray[np.int64], _read_lists(list[list[Annotated[int, Field(ge=0, le=10)]]], np.int64)]
