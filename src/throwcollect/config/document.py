"""Reads a YAML file into plain values, keeps the line of each, replaces values by overrides, and validates them."""

from __future__ import annotations

import stat
from collections.abc import Callable, Mapping
from functools import cache, lru_cache
from pathlib import Path
from typing import Any, TypeVar

from pydantic import ValidationError
from ruamel.yaml import YAML
from ruamel.yaml.constructor import SafeConstructor
from ruamel.yaml.error import MarkedYAMLError, YAMLError
from ruamel.yaml.nodes import MappingNode, Node, ScalarNode, SequenceNode

from throwcollect.config.default_path import DEFAULT_CONFIG
from throwcollect.config.problems import Location, find_problems, join_key, quote, read_index, split_key
from throwcollect.config.section import Section
from throwcollect.errors import ConfigError, Problem
from throwcollect.files import suggest_path
from throwcollect.wording import command

AnySection = TypeVar("AnySection", bound=Section)

Plain = bool | float | str | list[float] | None
"""A value in a mapping of a configuration."""

_TAG = "tag:yaml.org,2002:"
_TEXT_TAGS = ("timestamp", "merge", "value")
"""Tags of scalars that are strings here, although YAML 1.1 and ruamel give them another meaning."""
_MOST_BYTES = 1_000_000
_MOST_VALUES = 30_000
"""Most values: more than 500 weights for each of 32 joints. Aliases of aliases can make a short file far larger."""
_UNREADABLE = (YAMLError, RecursionError, ValueError, LookupError, OverflowError)
"""What ruamel raises: besides errors of its own, those of Python for scalars that their tags do not fit."""


class Document:
    """Values of a configuration file and of overrides, with the line of each.

    Args:
        path: The file; None if there are only overrides.

    Attributes:
        values: Plain dictionaries, lists, strings, numbers, truth values and None.
        problems: Keys that are there twice, and wrong overrides.
    """

    def __init__(self, path: Path | None) -> None:
        self.problems: list[Problem] = []
        self._path = path
        self._count = 0
        self._in_file = True
        self._lines: dict[Location, int | None] = {}
        if path is None:
            self.values: dict[str, Any] = {}
            self._in_file = False
            return
        try:
            node = compose(_read_text(path))
            self.values = {} if node is None else self._make_plain(node, ())
        except _UNREADABLE as error:
            reason, line = explain_yaml_error(error)
            raise ConfigError([Problem(f"not valid YAML: {reason}", path=path, line=line)]) from error
        if not isinstance(self.values, dict) or node is None:
            wrong = "the file is empty" if node is None else "the file should hold keys and values"
            raise ConfigError([Problem(wrong, path=path)], expected="keys such as task and sweep")
        self._in_file = False  # all further values are those of overrides

    def problem(self, location: Location, sentence: str) -> Problem:
        """Make a problem with the value or the key at a location, with the line in which it stands."""
        for length in range(len(location), 0, -1):
            if location[:length] in self._lines:
                line = self._lines[location[:length]]
                return Problem(sentence, join_key(location), self._path if line else None, line)
        return Problem(sentence, join_key(location), self._path)

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
        return self.problem(location, problem.message)

    def validate(self, section: type[AnySection], context: Any = None) -> AnySection:
        """Make a section of the values; the error has all problems, in the order of their lines."""
        try:
            made = section.model_validate(self.values, strict=True, context=context)
        except ValidationError as error:
            found = find_problems(error, section, self.values)
            problems = [*self.problems, *(self.problem(location, sentence) for location, sentence in found.items())]
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
                self._lines[location] = None
            holder = holder[index] if _has_item(holder, index) else None
        index = read_index(holder, last)
        if not isinstance(holder, dict) and not _has_item(holder, index):
            self.problems.append(Problem(f"nothing of this name can be set; got {quote(text)}", key))
            return
        location = (*location, index)
        # The override replaces these values, so they do not stand in lines of the file any more.
        self._lines = {known: line for known, line in self._lines.items() if known[: len(location)] != location}
        self._lines[location] = None
        try:
            node = compose(text)
            holder[index] = None if node is None else self._make_plain(node, location)
        except _UNREADABLE as error:
            self.problems.append(Problem(f"not valid YAML: {explain_yaml_error(error)[0]}; got {quote(text)}", key))

    def _make_plain(self, node: Node, location: Location) -> Any:
        self._count += 1
        if self._count > _MOST_VALUES:
            raise ValueError(f"there are more than {_MOST_VALUES} values")
        kind = str(node.tag).removeprefix(_TAG)
        if isinstance(node, MappingNode) and kind == "map":
            return self._make_mapping(node, location)
        if isinstance(node, SequenceNode) and kind == "seq":
            items = []
            for index, item in enumerate(node.value):
                self._lines[(*location, index)] = self._find_line(item)
                items.append(self._make_plain(item, (*location, index)))
            return items
        if isinstance(node, ScalarNode) and kind in _TEXT_TAGS:
            return node.value
        return _make_constructor().construct_object(node)

    def _make_mapping(self, node: MappingNode, location: Location) -> dict[str, Any]:
        values: dict[str, Any] = {}
        for key_node, value_node in node.value:
            name = str(key_node.value)
            if name in values:
                first = f", first in line {self._lines[(*location, name)]}" if self._in_file else ""
                path = self._path if self._in_file else None
                problem = f"the key is here twice{first}"
                self.problems.append(Problem(problem, join_key((*location, name)), path, self._find_line(key_node)))
                continue
            self._lines[(*location, name)] = self._find_line(key_node)
            values[name] = self._make_plain(value_node, (*location, name))
        return values

    def _find_line(self, node: Node) -> int | None:
        return node.start_mark.line + 1 if self._in_file else None


@lru_cache(maxsize=8)
def compose(text: str) -> Node | None:
    """Parse a YAML text into a node, which nobody may change; None if the text is empty.

    It remembers the last texts, because one command reads the configuration of a dataset several times.
    """
    node: Node | None = YAML(typ="safe", pure=True).compose(text)
    return node


def explain_yaml_error(error: Exception) -> tuple[str, int | None]:
    """Say why a text is not valid YAML, and in which line, counted from 1; None if the line is unknown."""
    if isinstance(error, RecursionError):
        return "values are nested too deeply", None
    if isinstance(error, MarkedYAMLError):
        mark = error.problem_mark or error.context_mark
        return ", ".join(filter(None, [error.problem, error.context])), mark.line + 1 if mark else None
    return str(error).partition("\n")[0], None


def _read_text(path: Path) -> str:
    try:
        if not stat.S_ISREG(kind := path.stat().st_mode):
            # To read a pipe or a device may block for ever.
            got = "a directory" if stat.S_ISDIR(kind) else "a pipe or a device"
            raise ConfigError([Problem(f"should be a YAML file, got {got}", path=path)])
        with path.open("rb") as file:
            data = file.read(_MOST_BYTES + 1)
        if len(data) > _MOST_BYTES:
            raise ConfigError([Problem(f"larger than {_MOST_BYTES} bytes", path=path)])
        return data.decode("utf-8")
    except FileNotFoundError as error:
        hint = f"{command('init')} writes one to begin with" if path == DEFAULT_CONFIG else None
        raise ConfigError([Problem(f"no such file{suggest_path(path)}", path=path)], hint=hint) from error
    except OSError as error:
        raise ConfigError([Problem(f"cannot be read: {error.strerror}", path=path)]) from error
    except UnicodeDecodeError as error:
        line = error.object.count(b"\n", 0, error.start) + 1
        sentence = f"should be UTF-8 text, got the byte 0x{error.object[error.start]:02x}"
        raise ConfigError([Problem(sentence, path=path, line=line)]) from error


@cache
def _make_constructor() -> SafeConstructor:
    constructor: SafeConstructor = YAML(typ="safe", pure=True).constructor
    return constructor


def _has_item(holder: Any, index: str | int) -> bool:
    if isinstance(holder, list):
        return isinstance(index, int) and index < len(holder)
    return isinstance(holder, dict) and index in holder
