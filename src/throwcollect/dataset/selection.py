"""Rows of the table of throws that fulfil a condition.

Conditions are written as in Python. Python only parses them, and Arrow evaluates them, so they are never run as code.
"""

from __future__ import annotations

import ast
from collections.abc import Callable, Iterable, Mapping
from functools import reduce
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.compute as pc

from throwcollect.errors import DatasetError, refuse_argument
from throwcollect.wording import suggest

_EXAMPLE = "such as: outcome == 'landed' and landing_x_m > 1.5"


def _floor_divide(left: Any, right: Any) -> Any:
    return pc.floor(pc.divide(left, right))


_OPERATIONS: Mapping[type[ast.AST], Callable[..., Any]] = {
    # As in SQL, `null and False` is false, and `null or True` is true.
    ast.And: pc.and_kleene,
    ast.Or: pc.or_kleene,
    ast.Not: pc.invert,
    ast.Eq: pc.equal,
    ast.NotEq: pc.not_equal,
    ast.Lt: pc.less,
    ast.LtE: pc.less_equal,
    ast.Gt: pc.greater,
    ast.GtE: pc.greater_equal,
    ast.Add: pc.add,
    ast.Sub: pc.subtract,
    ast.Mult: pc.multiply,
    ast.Div: pc.divide,
    ast.FloorDiv: _floor_divide,
    ast.Mod: lambda left, right: pc.subtract(left, pc.multiply(right, _floor_divide(left, right))),
    ast.Pow: pc.power,
    ast.USub: pc.negate,
}
_FUNCTIONS: Mapping[str, Callable[..., Any]] = {
    "abs": pc.abs,
    "sqrt": pc.sqrt,
    "hypot": lambda x, y: pc.sqrt(pc.add(pc.multiply(x, x), pc.multiply(y, y))),
}


def find_rows(condition: str, table: pa.Table, argument: str) -> Any:
    """Find the rows that fulfil a condition, as an Arrow mask; null, where a number is missing, is not fulfilled."""
    try:
        # In parentheses, it may go over several lines.
        mask = _evaluate(ast.parse(f"({condition})", mode="eval").body, table)
    except (SyntaxError, ValueError, TypeError, OverflowError, MemoryError, RecursionError, pa.ArrowException) as error:
        reason = str(error).partition("\n")[0]
        raise refuse_argument(argument, f"{condition!r} cannot be evaluated: {reason}", expected=_EXAMPLE) from error
    if not pa.types.is_boolean(mask.type):
        raise refuse_argument(argument, f"{condition!r} is no condition", expected=_EXAMPLE)
    return pa.repeat(mask, len(table)) if isinstance(mask, pa.Scalar) else mask


def _evaluate(node: ast.expr, table: pa.Table) -> Any:
    """Compute the value of a part of an expression: one value a row, or a scalar."""
    match node:
        case ast.Constant(value=bool() | str() | None as value):
            return pa.scalar(value)
        case ast.Constant(value=int() | float() as value):
            # Arrow's division of integers drops the remainder, and fails at 0.
            return pa.scalar(float(value))
        case ast.Name() | ast.Attribute():
            if (name := ast.unparse(node)) not in table.column_names:
                raise ValueError(f"no column {name}{suggest(name, table.column_names, 'docs/dataset.md')}")
            column = table[name]
            return column.cast(pa.float64(), safe=False) if pa.types.is_integer(column.type) else column
        case ast.BoolOp():
            return reduce(_OPERATIONS[type(node.op)], (_evaluate(part, table) for part in node.values))
        case ast.UnaryOp() if type(node.op) in _OPERATIONS:
            return _OPERATIONS[type(node.op)](_evaluate(node.operand, table))
        case ast.BinOp() if type(node.op) in _OPERATIONS:
            return _OPERATIONS[type(node.op)](_evaluate(node.left, table), _evaluate(node.right, table))
        case ast.Compare():
            # `a < b < c` is `a < b and b < c`, as in Python.
            lefts = [node.left, *node.comparators]
            pairs = zip(lefts, node.ops, node.comparators, strict=False)
            return reduce(pc.and_kleene, (_compare(left, by, right, table) for left, by, right in pairs))
        case ast.Call(func=ast.Name(id=name), args=arguments, keywords=[]) if name in _FUNCTIONS:
            return _FUNCTIONS[name](*(_evaluate(each, table) for each in arguments))
    raise ValueError(f"{ast.unparse(node)} is none of: column, number, string, comparison, and, or, not, arithmetic")


def _compare(left: ast.expr, operator: ast.cmpop, right: ast.expr, table: pa.Table) -> Any:
    match operator, right:
        case ((ast.Is() | ast.Eq()), ast.Constant(value=None)):
            return pc.is_null(_evaluate(left, table))
        case ((ast.IsNot() | ast.NotEq()), ast.Constant(value=None)):
            return pc.is_valid(_evaluate(left, table))
        case ast.In(), (ast.List() | ast.Tuple() | ast.Set()):
            equal = (_compare(left, ast.Eq(), each, table) for each in right.elts)
            return reduce(pc.or_kleene, equal, pa.scalar(False))
        case ast.NotIn(), _:
            return pc.invert(_compare(left, ast.In(), right, table))
    if type(operator) not in _OPERATIONS:
        raise ValueError("`is` is for None alone, and `in` for a list such as ['landed', 'recaught']")
    return _OPERATIONS[type(operator)](_evaluate(left, table), _evaluate(right, table))


def select_throws(throws: pa.Table, which: str | Iterable[Any], directory: Path) -> pa.Table:
    """Select rows of the table of throws of the dataset in a directory; `which` is as for `Dataset.select`."""
    if isinstance(which, str):
        which = find_rows(which, throws, "which")
    if isinstance(which, pc.Expression):
        return throws.filter(which)
    values = which.combine_chunks() if isinstance(which, pa.ChunkedArray) else which
    if not isinstance(values, pa.Array):
        values = pa.array(values if hasattr(values, "__len__") else list(values))
    if pa.types.is_boolean(values.type):
        return throws.filter(values)
    rows = pc.index_in(values.cast(pa.int64()), value_set=throws["trial"].combine_chunks())
    if rows.null_count:
        missing = values.filter(pc.is_null(rows))[0]
        raise DatasetError(f"no trial {missing} among the {len(throws)} throws", path=directory)
    return throws.take(rows)
