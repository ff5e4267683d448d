"""POSIX extended regular expressions, searched in time that grows with pattern times text and never faster.

Python's own expressions go back and try again, for ever on some patterns; here all ways to match are followed at once
(Thompson's construction). Only whether there is a match is told, which is all that a filter needs.
"""

from __future__ import annotations

import string
from collections.abc import Callable, Iterable
from dataclasses import dataclass

_LONGEST_PATTERN = 256
_MOST_PARTS = 1000
_LARGEST_REPETITION = 255
"""RE_DUP_MAX of POSIX."""

_Accepts = Callable[[str], bool]

_CLASSES: dict[str, _Accepts] = {
    "alnum": str.isalnum,
    "alpha": str.isalpha,
    "blank": " \t".__contains__,
    "cntrl": lambda char: ord(char) < 32 or ord(char) == 127,
    "digit": string.digits.__contains__,
    "graph": lambda char: char.isprintable() and char != " ",
    "lower": str.islower,
    "print": str.isprintable,
    "punct": string.punctuation.__contains__,
    "space": str.isspace,
    "upper": str.isupper,
    "xdigit": string.hexdigits.__contains__,
}


@dataclass(frozen=True)
class _Node:
    """A part of a pattern.

    Attributes:
        kind: ``char``, ``begin``, ``end``, ``sequence``, ``choice`` or ``repeat``.
        accepts: For ``char``: whether it matches a character.
        parts: The parts of the others.
        least: For ``repeat``: least number of times.
        most: For ``repeat``: greatest number of times; None for no limit.
    """

    kind: str
    accepts: _Accepts | None = None
    parts: tuple[_Node, ...] = ()
    least: int = 0
    most: int | None = None


@dataclass(frozen=True)
class _Instruction:
    """One step of a search: what to accept before going on, or where else to go on.

    Attributes:
        accepts: Whether a character leads on to the next instruction; None if none is consumed.
        anchor: ``begin`` or ``end`` if that leads on to the next one.
        targets: Instructions to go on with as well.
    """

    accepts: _Accepts | None = None
    anchor: str = ""
    targets: tuple[int, ...] = ()


class ExtendedRegex:
    """A compiled expression.

    Args:
        pattern: The expression. What POSIX leaves undefined is refused or means what it means to GNU grep -E.

    Raises:
        ValueError: If it is malformed or too large.
    """

    def __init__(self, pattern: str) -> None:
        if len(pattern) > _LONGEST_PATTERN:
            raise ValueError(f"{len(pattern)} characters; at most {_LONGEST_PATTERN}")
        self._program: list[_Instruction] = []
        self._parts = 0
        self._emit(_Parser(pattern).parse())

    def search(self, text: str) -> bool:
        """Whether the expression matches anywhere in a text."""
        consumed: set[int] = set()
        for position in range(len(text) + 1):
            reached = self._reach({0, *consumed}, begins=position == 0, ends=position == len(text))
            if len(self._program) in reached:
                return True
            if position < len(text):
                consumed = {place + 1 for place in reached if self._accepts(place, text[position])}
        return False

    def _accepts(self, place: int, char: str) -> bool:
        accepts = self._program[place].accepts
        return accepts is not None and accepts(char)

    def _reach(self, places: Iterable[int], *, begins: bool, ends: bool) -> set[int]:
        """All instructions that can be gone to without consuming a character."""
        reached: set[int] = set()
        waiting = list(places)
        while waiting:
            place = waiting.pop()
            if place in reached:
                continue
            reached.add(place)
            if place == len(self._program):
                continue
            instruction = self._program[place]
            waiting.extend(instruction.targets)
            if (instruction.anchor == "begin" and begins) or (instruction.anchor == "end" and ends):
                waiting.append(place + 1)
        return reached

    def _emit(self, node: _Node) -> None:
        # Counted one by one, as repetitions of nothing make no program but take their time all the same.
        self._parts += 1
        if self._parts > _MOST_PARTS:
            raise ValueError(f"the repetitions multiply to more than {_MOST_PARTS} parts")
        if node.kind == "char":
            self._program.append(_Instruction(accepts=node.accepts))
        elif node.kind in ("begin", "end"):
            self._program.append(_Instruction(anchor=node.kind))
        elif node.kind == "sequence":
            for part in node.parts:
                self._emit(part)
        elif node.kind == "choice":
            self._emit_choice(node.parts)
        else:
            self._emit_repetition(node)

    def _emit_choice(self, parts: tuple[_Node, ...]) -> None:
        exits = []
        for part in parts:
            fork = self._reserve()
            self._emit(part)
            exits.append(self._reserve())
            self._program[fork] = _Instruction(targets=(fork + 1, len(self._program)))
        # Behind the last way there is no other one to try.
        self._program[fork] = _Instruction(targets=(fork + 1,))
        for place in exits:
            self._program[place] = _Instruction(targets=(len(self._program),))

    def _emit_repetition(self, node: _Node) -> None:
        (part,) = node.parts
        for _ in range(node.least):
            self._emit(part)
        if node.most is None:
            fork = self._reserve()
            self._emit(part)
            self._program.append(_Instruction(targets=(fork,)))
            self._program[fork] = _Instruction(targets=(fork + 1, len(self._program)))
            return
        forks = []
        for _ in range(node.most - node.least):
            forks.append(self._reserve())
            self._emit(part)
        for fork in forks:
            self._program[fork] = _Instruction(targets=(fork + 1, len(self._program)))

    def _reserve(self) -> int:
        self._program.append(_Instruction())
        return len(self._program) - 1


class _Parser:
    """Recursive descent over a pattern."""

    def __init__(self, pattern: str) -> None:
        self._pattern = pattern
        self._place = 0

    def parse(self) -> _Node:
        node = self._choice()
        if self._place < len(self._pattern):
            raise self._error("unmatched )")
        return node

    def _error(self, message: str) -> ValueError:
        return ValueError(f"character {self._place + 1}: {message}")

    @property
    def _next(self) -> str:
        return self._pattern[self._place : self._place + 1]

    def _take(self) -> str:
        char = self._next
        if not char:
            raise self._error("the expression ends too early")
        self._place += 1
        return char

    def _skip(self, text: str) -> bool:
        found = self._pattern.startswith(text, self._place)
        self._place += len(text) * found
        return found

    def _choice(self) -> _Node:
        parts = [self._sequence()]
        while self._skip("|"):
            parts.append(self._sequence())
        return parts[0] if len(parts) == 1 else _Node("choice", parts=tuple(parts))

    def _sequence(self) -> _Node:
        parts = []
        while self._next and self._next not in "|)":
            parts.append(self._repetition())
        return _Node("sequence", parts=tuple(parts))

    def _repetition(self) -> _Node:
        node = self._atom()
        while self._next and self._next in "*+?{":
            least, most = self._bounds()
            node = _Node("repeat", parts=(node,), least=least, most=most)
        return node

    def _bounds(self) -> tuple[int, int | None]:
        kind = self._take()
        if kind != "{":
            return {"*": (0, None), "+": (1, None), "?": (0, 1)}[kind]
        inside, closed, _ = self._pattern[self._place :].partition("}")
        low, comma, high = inside.partition(",")
        numbers = [number for number in (low, high) if number]
        if not (closed and low and all(set(number) <= set(string.digits) for number in numbers)):
            raise self._error("expected {m}, {m,} or {m,n}")
        self._place += len(inside) + 1
        least = int(low)
        most = int(high) if high else None if comma else least
        if max(map(int, numbers)) > _LARGEST_REPETITION or (most is not None and most < least):
            raise self._error(f"repetitions should rise, to at most {_LARGEST_REPETITION}")
        return least, most

    def _atom(self) -> _Node:
        char = self._take()
        if char == "(":
            node = self._choice()
            if not self._skip(")"):
                raise self._error("unmatched (")
            return node
        if char in "^$":
            return _Node("begin" if char == "^" else "end")
        if char == ".":
            return _Node("char", accepts=lambda _: True)
        if char == "[":
            return _Node("char", accepts=self._bracket())
        if char in "*+?{":
            raise self._error(f"nothing before {char} to repeat")
        if char == "\\":
            char = self._take()
            if char.isalnum():
                raise self._error(f"\\{char} is not part of extended regular expressions")
        return _Node("char", accepts=char.__eq__)

    def _bracket(self) -> _Accepts:
        negated = self._skip("^")
        accepting: list[_Accepts] = []
        while not accepting or self._next != "]":
            if self._skip("[:"):
                name, closed, _ = self._pattern[self._place :].partition(":]")
                if not closed or name not in _CLASSES:
                    raise self._error(f"unknown class of characters; known: {', '.join(_CLASSES)}")
                self._place += len(name) + 2
                accepting.append(_CLASSES[name])
                continue
            low = high = self._element()
            if self._next == "-" and self._pattern[self._place + 1 : self._place + 2] not in ("]", ""):
                self._place += 1
                high = self._element()
            if high < low:
                raise self._error(f"range {low}-{high} is empty")
            accepting.append(lambda char, low=low, high=high: low <= char <= high)  # type: ignore[misc]
        self._place += 1
        return lambda char: any(accepts(char) for accepts in accepting) != negated

    def _element(self) -> str:
        for mark in ".=":
            if self._skip(f"[{mark}"):
                char = self._take()
                if not self._skip(f"{mark}]"):
                    raise self._error(f"expected one character in [{mark} {mark}]")
                return char
        return self._take()
