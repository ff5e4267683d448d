"""Values of other packages are of the types that are declared for them, down to the last field."""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from throwcollect.declared_types import check_type


@dataclass(frozen=True)
class Edge:
    """A part of a value."""

    length_m: float


@dataclass(frozen=True)
class Shape:
    """A value with fields of every kind that our own classes declare."""

    title: str
    edges: tuple[Edge, ...] = ()
    sizes: Mapping[str, float] | None = None
    corners: NDArray[np.float64] | None = None
    draw: Callable[[], None] = print


@pytest.mark.parametrize(
    "value",
    [
        Shape("a"),
        Shape("a", (Edge(1.0), Edge(np.float64(2.0)), Edge(3)), {"b": 1.0}, np.zeros((2, 3)), lambda: None),
    ],
)
def test_a_right_value_passes(value: Shape) -> None:
    check_type("the shape", value, Shape)


@pytest.mark.parametrize(
    ("value", "said"),
    [
        (3, "the shape: should be an instance of Shape, is 3"),
        (Shape(3), "the shape.title: should be a valid string, is 3"),  # type: ignore[arg-type]
        (Shape("a", [Edge(1.0)]), "the shape.edges: should be a valid tuple, is [Edge("),  # type: ignore[arg-type]
        (Shape("a", (Edge(1.0), Edge("b"))), "the shape.edges.1.length_m: should be a valid number, is 'b'"),  # type: ignore[arg-type]
        (Shape("a", (Edge(math.nan),)), "the shape.edges.0.length_m: should be a finite number, is nan"),
        (Shape("a", sizes={"b": -math.inf}), "the shape.sizes.b: should be a finite number, is -inf"),
        (Shape("a", corners=[1.0]), "the shape.corners: should be an instance of ndarray, is [1.0]"),  # type: ignore[arg-type]
        (Shape("a", draw=3), "the shape.draw: should be callable, is 3"),  # type: ignore[arg-type]
    ],
)
def test_anything_of_another_type_is_an_error_that_says_where_it_is(value: Any, said: str) -> None:
    with pytest.raises(TypeError) as caught:
        check_type("the shape", value, Shape)
    assert said in str(caught.value)


def test_a_class_has_to_be_derived_from_the_declared_one() -> None:
    check_type("its class", bool, type[int])
    with pytest.raises(TypeError, match="its class: should be a subclass of int, is <class 'str'>"):
        check_type("its class", str, type[int])
