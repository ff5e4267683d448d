"""Reads a YAML file into plain values, replaces values by overrides, and finds the lines of what is wrong in it."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping
from functools import lru_cache
from pathlib import Path
from typing import Any, TypeVar

from pydantic import ValidationError
from ruamel.yaml import YAML
from ruamel.yaml.constructor import SafeConstructor
from ruamel.yaml.error import MarkedYAMLError, YAMLError
from ruamel.yaml.nodes import MappingNode, Node, SequenceNode

from throwcollect.config.default_path import DEFAULT_CONFIG
from throwcollect.config.problems import Location, find_problems, join_key, quote, read_index, split_key
from throwcollect.config.section import Section
from throwcollect.errors import ConfigError, DatasetError, Problem
from throwcollect.files import read_text, suggest_path
from throwcollect.wording import command

AnySection = TypeVar("AnySection", bound=Section)

Plain = bool | float | str | list[float] | None
"""A value in a mapping of a configuration."""

_MOST_BYTES = 1_000_000
_MOST_VALUES = 30_000
"""Most values: more than 500 weights for each of 32 joints. Aliases of aliases can make a short file far larger."""
_UNREADABLE = (YAMLError, RecursionError, ValueError, LookupError, OverflowError)
"""What ruamel raises: besides errors of its own, those of Python for scalars that their tags do not fit."""


class _Constructor(SafeConstructor):
    """Makes plain values, and leaves dates as they are written."""


_Constructor.add_constructor("tag:yaml.org,2002:timestamp", SafeConstructor.construct_yaml_str)


class Document:
    """Values of a configuration file and of overrides.

    Args:
        path: The file; None if there are only overrides.

    Attributes:
        values: Plain dictionaries, lists, strings, numbers, truth values and None.
        problems: Wrong overrides.
    """

    def __init__(self, path: Path | None) -> None:
        self.problems: list[Problem] = []
        self.values: dict[str, Any] = {}
        self._path = path
        self._overridden: list[Location] = []
        self._node: Node | None = None
        if path is None:
            return
        try:
            self._node = _compose(_read_text(path))
            self.values = _construct(self._node)
        except _UNREADABLE as error:
            reason, line = explain_yaml_error(error)
            raise ConfigError([Problem(f"not valid YAML: {reason}", path=path, line=line)]) from error
        if not isinstance(self.values, dict):
            wrong = "the file is empty" if self._node is None else "the file should hold keys and values"
            raise ConfigError([Problem(wrong, path=path)], expected="keys such as task and sweep")

    def make_problem(self, location: Location, sentence: str) -> Problem:
        """Make a problem with the value or the key at a location, with the line in which it stands."""
        lines = _find_lines(self._node, location)
        is_whole = len(lines) == len(location)
        for each in self._overridden:
            if each == location[: len(each)] or (each[: len(location)] == location and not is_whole):
                return Problem(sentence, join_key(location))
        return Problem(sentence, join_key(location), self._path, lines[-1] if lines else None)

    def place(self, problem: Problem) -> Problem:
        """Return a problem with the file and the line of its key, if it has a key but no file yet."""
        if problem.path or not problem.key:
            return problem
        location: Location = ()
        holder: Any = self.values
        for part in split_key(problem.key):
            index = read_index(holder, part)
            location = (*location, index)
            holder = holder[index] if _has_item(holder, index) else None
        return self.make_problem(location, problem.message)

    def validate(self, section: type[AnySection]) -> AnySection:
        """Make a section of the values; the error has all problems, in the order of their lines."""
        try:
            made = section.model_validate(self.values, strict=True)
        except ValidationError as error:
            found = find_problems(error, section, self.values)
            problems = [
                *self.problems,
                *(self.make_problem(location, sentence) for location, sentence in found.items()),
            ]
            raise ConfigError(sorted(problems, key=lambda problem: problem.line or 0)) from error
        if self.problems:
            raise ConfigError(self.problems)
        return made

    def override(
        self, given: str, *, find_default: Callable[[Location], Mapping[str, Plain]] = lambda _location: {}
    ) -> None:
        """Replace one key; errors in the override are added to the problems.

        Args:
            given: Dotted key, equals sign and value, as in ``task.duration_s=1.1``; the value is read as YAML.
            find_default: Finds the default of a mapping that the file leaves out, so that the override replaces one key
                in it and keeps the others.
        """
        key, equals, text = given.partition("=")
        key = key.strip()
        if not equals or not all(key.split(".")):
            self.problems.append(Problem(f"an override should be KEY=VALUE, got {quote(given)}"))
            return
        *above, last = split_key(key)
        holder: Any = self.values
        location: Location = ()
        for part in above:
            index = read_index(holder, part)
            location = (*location, index)
            # A mapping that the file leaves out gets its default, so that the override changes only one key of it.
            if isinstance(holder, dict) and holder.get(part) is None:
                holder[part] = dict(find_default(location))
            holder = holder[index] if _has_item(holder, index) else None
        index = read_index(holder, last)
        if not isinstance(holder, dict) and not _has_item(holder, index):
            self.problems.append(Problem(f"nothing of this name can be set; got {quote(text)}", key))
            return
        self._overridden.append((*location, index))
        try:
            holder[index] = _construct(_compose(text))
        except _UNREADABLE as error:
            self.problems.append(Problem(f"not valid YAML: {explain_yaml_error(error)[0]}; got {quote(text)}", key))


@lru_cache(maxsize=8)
def _compose(text: str) -> Node | None:
    """Parse a YAML text into a node, which callers must not change; None if the text is empty.

    It remembers the last texts, because one command reads the configuration of a dataset several times.
    """
    node: Node | None = YAML(typ="safe", pure=True).compose(text)
    return node


def _construct(node: Node | None) -> Any:
    if node is None:
        return None
    yaml = YAML(typ="safe", pure=True)
    yaml.Constructor = _Constructor
    return _copy(yaml.constructor.construct_document(node), [_MOST_VALUES])


def _copy(value: Any, left: list[int]) -> Any:
    """Copy values, so that aliases of one anchor can be changed each on its own; keys become strings."""
    left[0] -= 1
    if left[0] < 0:
        raise ValueError(f"there are more than {_MOST_VALUES} values")
    if isinstance(value, dict):
        copied = {str(key): _copy(each, left) for key, each in value.items()}
        if len(copied) < len(value):
            raise ValueError(f"a key is here twice, as a number and as a string: {', '.join(map(repr, value))}")
        return copied
    return [_copy(each, left) for each in value] if isinstance(value, list) else value


def _find_lines(node: Node | None, location: Location) -> list[int]:
    """Find the lines, counted from 1, of the keys and items on the way to a location, as far as they exist."""
    lines = []
    for part in location:
        found: list[tuple[Node, Node]] = []
        if isinstance(node, MappingNode):
            found = [(key, value) for key, value in node.value if str(key.value) == part]
        elif isinstance(node, SequenceNode) and isinstance(part, int):
            found = [(item, item) for item in node.value[part : part + 1]]
        if not found:
            break
        lines.append(found[0][0].start_mark.line + 1)
        node = found[0][1]
    return lines


def explain_yaml_error(error: Exception) -> tuple[str, int | None]:
    """Explain why a text is not valid YAML, and in which line, counted from 1; None if the line is unknown."""
    if isinstance(error, RecursionError):
        return "values are nested too deeply", None
    if isinstance(error, MarkedYAMLError):
        mark = error.problem_mark or error.context_mark
        return ", ".join(filter(None, [error.problem, error.context])), mark.line + 1 if mark else None
    return str(error).partition("\n")[0], None


def _read_text(path: Path) -> str:
    if not os.path.exists(path):
        hint = f"{command('init')} writes one to begin with" if path == DEFAULT_CONFIG else None
        raise ConfigError([Problem(f"no such file{suggest_path(path)}", path=path)], hint=hint)
    try:
        return read_text(path.resolve(), most_bytes=_MOST_BYTES)
    except DatasetError as error:
        raise ConfigError([Problem(error.problem, path=path)]) from error


def _has_item(holder: Any, index: str | int) -> bool:
    if isinstance(holder, list):
        return isinstance(index, int) and index < len(holder)
    return isinstance(holder, dict) and index in holder
