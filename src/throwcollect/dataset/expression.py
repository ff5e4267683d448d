"""Conditions and numbers computed from the columns of a table, written as Python writes them.

Python only parses the text, and this module evaluates it with Arrow, so it is never run as code. Names with dots are
names of columns, and ``weights.arm_right_4_joint[0]`` is the column ``weights.arm_right_4_joint.0``. A null stays null
in comparisons and arithmetic, and a null condition is not fulfilled.
"""

from __future__ import annotations

import ast
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import reduce
from typing import Any, Literal

import pyarrow as pa
import pyarrow.compute as pc

from throwcollect.arguments import show_value
from throwcollect.errors import ConfigError, Problem
from throwcollect.wording import suggest

_SHOWN = 100
"""Most characters of an expression that a message shows."""

_EXAMPLE = "outcome == 'landed' and landing_x_m > 1.5"

_Kind = Literal["a number", "text", "a condition", "None"]

_COMPARISONS: Mapping[type[ast.cmpop], Callable[..., Any]] = {
    ast.Eq: pc.equal,
    ast.NotEq: pc.not_equal,
    ast.Lt: pc.less,
    ast.LtE: pc.less_equal,
    ast.Gt: pc.greater,
    ast.GtE: pc.greater_equal,
}


def _floor_divide(left: Any, right: Any) -> Any:
    return pc.floor(pc.divide(left, right))


def _remainder(left: Any, right: Any) -> Any:
    return pc.subtract(left, pc.multiply(right, _floor_divide(left, right)))


_ARITHMETIC: Mapping[type[ast.operator], Callable[..., Any]] = {
    ast.Add: pc.add,
    ast.Sub: pc.subtract,
    ast.Mult: pc.multiply,
    ast.Div: pc.divide,
    ast.FloorDiv: _floor_divide,
    ast.Mod: _remainder,
    ast.Pow: pc.power,
}


def _hypot(x: Any, y: Any) -> Any:
    return pc.sqrt(pc.add(pc.multiply(x, x), pc.multiply(y, y)))


_FUNCTIONS: Mapping[str, tuple[int, Callable[..., Any]]] = {
    "abs": (1, pc.abs),
    "sqrt": (1, pc.sqrt),
    "hypot": (2, _hypot),
}
"""Number of arguments, and the function."""


@dataclass(frozen=True)
class _Value:
    """The value of a part of an expression: an Arrow array with one value a row, or a scalar for all of them."""

    kind: _Kind
    data: Any


class Expression:
    """An expression on the columns of a table.

    Args:
        text: The expression.
        place: What messages begin with: the argument that the expression was given as, such as ``where``.
        is_argument: Whether `place` is an argument, for which commands have an option.

    Raises:
        ConfigError: If it is no expression, or no text; all methods raise it for what cannot be evaluated.
    """

    def __init__(self, text: str, *, place: str, is_argument: bool = True) -> None:
        if not isinstance(text, str):
            expected = f"a text, such as: {_EXAMPLE}"
            raise ConfigError([Problem(f"got {show_value(text)}", place, argument=is_argument)], expected=expected)
        # Python would take a line break for the end of the expression.
        self._text = " ".join(text.splitlines()).strip()
        self._place = place
        self._is_argument = is_argument
        try:
            self._tree = ast.parse(self._text, mode="eval").body
        except SyntaxError as error:
            # Python gives no place, or 0, to an expression that ends too early.
            column = error.offset - 1 if error.offset else len(self._text)
            raise self._make_error(column, f"cannot be understood: {error.msg}", example=True) from error
        except (ValueError, RecursionError, MemoryError) as error:
            raise self._make_error(0, "cannot be understood", example=True) from error

    def rows(self, table: pa.Table) -> list[int]:
        """List the numbers of the rows that fulfil the expression as a condition."""
        found = self._evaluate(table, "a condition")
        return [number for number, holds in enumerate(found.to_pylist()) if holds]

    def numbers(self, table: pa.Table) -> list[float | None]:
        """Compute the expression's number in each row; None where it is null."""
        values: list[float | None] = self._evaluate(table, "a number").to_pylist()
        return values

    def _evaluate(self, table: pa.Table, kind: _Kind) -> Any:
        try:
            value = _Evaluation(table, self._make_error_at).value(self._tree)
        except RecursionError as error:
            raise self._make_error(0, "is nested too deeply") from error
        if value.kind != kind:
            raise self._make_error(0, f"should be {kind}, is {value.kind}")
        if isinstance(value.data, pa.Scalar):
            return pa.repeat(value.data, len(table))
        return value.data

    def _make_error_at(self, node: ast.expr, problem: str) -> ConfigError:
        # Python counts bytes, people count characters.
        before = self._text.encode()[: node.col_offset].decode()
        return self._make_error(len(before), problem)

    def _make_error(self, column: int, problem: str, *, example: bool = False) -> ConfigError:
        start = max(0, column - _SHOWN // 2)
        shown = f"\n    {self._text[start : start + _SHOWN]}\n    {' ' * (column - start)}^"
        return ConfigError(
            [Problem(f"{problem} (character {column + 1}){shown}", self._place, argument=self._is_argument)],
            expected=f"such as: {_EXAMPLE}" if example else None,
        )


class _Evaluation:
    """Evaluates parts of an expression on a table; `error` makes an error that points to a part."""

    def __init__(self, table: pa.Table, error: Callable[[ast.expr, str], ConfigError]) -> None:
        self._table = table
        self._make_error = error

    def value(self, node: ast.expr) -> _Value:
        """Compute the value of a part."""
        match node:
            case ast.Constant():
                return self._read_constant(node)
            case ast.Name() | ast.Attribute() | ast.Subscript():
                return self._read_column(node)
            case ast.BoolOp():
                # As in SQL, `null and False` is false, and `null or True` is true.
                combine = pc.and_kleene if isinstance(node.op, ast.And) else pc.or_kleene
                return _Value(
                    "a condition", reduce(combine, [self._evaluate_as(part, "a condition") for part in node.values])
                )
            case ast.UnaryOp(op=ast.Not()):
                return _Value("a condition", pc.invert(self._evaluate_as(node.operand, "a condition")))
            case ast.UnaryOp(op=ast.USub()):
                return _Value("a number", pc.negate(self._evaluate_as(node.operand, "a number")))
            case ast.UnaryOp(op=ast.UAdd()):
                return _Value("a number", self._evaluate_as(node.operand, "a number"))
            case ast.BinOp() if operation := _ARITHMETIC.get(type(node.op)):
                operands = self._evaluate_as(node.left, "a number"), self._evaluate_as(node.right, "a number")
                return _Value("a number", operation(*operands))
            case ast.Compare():
                return self._evaluate_comparison(node)
            case ast.Call(func=ast.Name(id=name), args=arguments, keywords=[]) if name in _FUNCTIONS:
                count, function = _FUNCTIONS[name]
                if len(arguments) != count:
                    raise self._make_error(node, f"{name} takes {count} number{'s' if count > 1 else ''}")
                return _Value("a number", function(*(self._evaluate_as(each, "a number") for each in arguments)))
        hint = "use `and`, `or`, `not`" if isinstance(node, ast.BinOp) else f"known functions: {', '.join(_FUNCTIONS)}"
        raise self._make_error(
            node, f"only comparisons, `and`, `or`, `not`, arithmetic and columns are allowed; {hint}"
        )

    def _evaluate_as(self, node: ast.expr, kind: _Kind) -> Any:
        value = self.value(node)
        if value.kind != kind:
            raise self._make_error(node, f"should be {kind}, is {value.kind}")
        return value.data

    def _read_constant(self, node: ast.Constant) -> _Value:
        match node.value:
            # This comes before numbers, as True is an `int` in Python.
            case bool():
                return _Value("a condition", pa.scalar(node.value))
            case int() | float():
                try:
                    # Whole numbers, too: Arrow's division of integers drops the remainder, and fails at 0.
                    return _Value("a number", pa.scalar(float(node.value)))
                except OverflowError as error:
                    raise self._make_error(node, "too large a number") from error
            case str():
                return _Value("text", pa.scalar(node.value))
            case None:
                return _Value("None", pa.scalar(None))
        raise self._make_error(node, "should be a number, a text in quotes, True, False or None")

    def _read_column(self, node: ast.expr) -> _Value:
        name = self._name(node)
        known = self._table.column_names
        if name not in known:
            meant = suggest(name, known, "a text needs quotes, and docs/dataset.md")
            raise self._make_error(node, f"no column {name!r}{meant}")
        column = self._table[name]
        if pa.types.is_string(column.type):
            return _Value("text", column)
        # The numbers of a damaged table may be too large for a float to be exact.
        return _Value("a number", column.cast(pa.float64(), safe=False))

    def _name(self, node: ast.expr) -> str:
        match node:
            case ast.Name():
                return node.id
            case ast.Attribute():
                return f"{self._name(node.value)}.{node.attr}"
            case ast.Subscript(slice=ast.Constant(value=int(index))):
                return f"{self._name(node.value)}.{index}"
        raise self._make_error(node, "should be the name of a column")

    def _evaluate_comparison(self, node: ast.Compare) -> _Value:
        parts = []
        operands = [node.left, *node.comparators]
        # `a < b < c` is `a < b and b < c`, as in Python.
        for left, operator, right in zip(operands, node.ops, operands[1:], strict=False):
            if isinstance(operator, ast.In | ast.NotIn):
                found = self._evaluate_membership(left, right)
                parts.append(pc.invert(found) if isinstance(operator, ast.NotIn) else found)
            else:
                parts.append(self._compare(left, operator, right))
        return _Value("a condition", reduce(pc.and_kleene, parts))

    def _compare(self, left: ast.expr, operator: ast.cmpop, right: ast.expr) -> Any:
        a, b = self.value(left), self.value(right)
        if b.kind == "None":
            if isinstance(operator, ast.Is | ast.IsNot | ast.Eq | ast.NotEq):
                return pc.is_null(a.data) if isinstance(operator, ast.Is | ast.Eq) else pc.is_valid(a.data)
            raise self._make_error(right, "None can be compared by `is` and `is not` only")
        if isinstance(operator, ast.Is | ast.IsNot):
            raise self._make_error(right, "`is` is for None only; use == or !=")
        if a.kind != b.kind:
            raise self._make_error(right, f"{b.kind} cannot be compared with {a.kind}")
        if a.kind == "a condition" and not isinstance(operator, ast.Eq | ast.NotEq):
            raise self._make_error(right, "conditions can be compared by == and != only")
        return _COMPARISONS[type(operator)](a.data, b.data)

    def _evaluate_membership(self, left: ast.expr, right: ast.expr) -> Any:
        if not isinstance(right, ast.List | ast.Tuple | ast.Set) or not right.elts:
            raise self._make_error(right, "should be a list, such as ['landed', 'recaught']")
        equal = [self._compare(left, ast.Eq(), element) for element in right.elts]
        return reduce(pc.or_kleene, equal)
