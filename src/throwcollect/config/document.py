"""Reads a YAML file into plain values, keeps the line of each, and replaces values by overrides."""

from __future__ import annotations

import stat
from collections.abc import Callable, Mapping
from functools import cache
from pathlib import Path
from typing import Any

from ruamel.yaml import YAML
from ruamel.yaml.constructor import SafeConstructor
from ruamel.yaml.error import YAMLError
from ruamel.yaml.nodes import MappingNode, Node, ScalarNode, SequenceNode

from throwcollect.config.default_path import DEFAULT_CONFIG
from throwcollect.config.problems import Location, join_key, quote, split_key
from throwcollect.config.shape import index_or_key
from throwcollect.config.yaml_nodes import MOST_LEVELS, MOST_VALUES, compose, line, reason
from throwcollect.errors import ConfigError, Problem
from throwcollect.files import recognise, suggest_path
from throwcollect.wording import command

Plain = bool | float | str | list[float] | None
"""A value in a mapping of a configuration."""

_TAG = "tag:yaml.org,2002:"
_MOST_BYTES = 5_000_000
_MOST_BITS = 1023
"""Most binary digits of a whole number; every such number can be a float."""
_NO_MERGING = "merge keys (<<) are not supported; write the keys out, or put an alias in place of the whole value"


class Document:
    """Values of a configuration file and of overrides, with the line of each.

    Raises:
        ConfigError: If the file cannot be read or is not YAML.

    Attributes:
        values: Plain dictionaries, lists, text, numbers, truth values and None.
        problems: Problems of the YAML and of overrides, which are known before the values are validated.
        left_out: Locations of values that are None because they were wrong; a problem says what was wrong with each.
    """

    def __init__(self, path: Path) -> None:
        self.values: dict[str, Any] = {}
        self.problems: list[Problem] = []
        self.left_out: set[Location] = set()
        self._path = path
        self._count = 0
        self._in_file = True
        self._lines: dict[Location, int | None] = {}
        try:
            node = compose(_read_text(path))
        except YAMLError as error:
            raise ConfigError([Problem(f"not valid YAML: {reason(error)}", path=path, line=line(error))]) from error
        if node is None:
            raise ConfigError([Problem("the file is empty", path=path)], expected="keys such as task and sweep")
        if not isinstance(node, MappingNode):
            problem = Problem("the file should hold keys and values", path=path, line=node.start_mark.line + 1)
            raise ConfigError([problem], expected="keys such as task and sweep")
        values = self._make_plain(node, ())
        if not isinstance(values, dict):
            raise ConfigError(self.problems)
        self.values = values
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
            index = _read_index(holder, part)
            location = (*location, index)
            holder = holder[index] if _has_item(holder, index) else None
        return self.problem(location, problem.message)

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
        try:
            node = compose(text)
        except YAMLError as error:
            self.problems.append(Problem(f"not valid YAML: {reason(error)}; got {quote(text)}", key))
            return
        *above, last = split_key(key)
        if len(above) >= MOST_LEVELS:
            self.problems.append(Problem("the key is nested too deeply", key))
            return
        holder: Any = self.values
        location: Location = ()
        for part in above:
            index = _read_index(holder, part)
            location = (*location, index)
            # A mapping that the file leaves out gets its default, so that the override changes only one key of it.
            if isinstance(holder, dict) and holder.get(part) is None:
                holder[part] = dict(find_default(location))
                self._lines[location] = None
            holder = holder[index] if _has_item(holder, index) else None
        index = _read_index(holder, last)
        if not isinstance(holder, dict) and not _has_item(holder, index):
            self.problems.append(Problem(f"nothing of this name can be set; got {quote(text)}", key))
            return
        location = (*location, index)
        # The override replaces these values, so they do not stand in lines of the file any more.
        self._lines = {known: line for known, line in self._lines.items() if known[: len(location)] != location}
        self._lines[location] = None
        holder[index] = self._make_plain(node, location)

    def is_overridden(self, location: Location) -> bool:
        """Whether an override has given the value at a location."""
        return self._lines.get(location, 0) is None

    def _make_plain(self, node: Node | None, location: Location, inside: tuple[Node, ...] = ()) -> Any:
        if node is None:
            return None
        self._count += 1
        if self._count > MOST_VALUES:
            # Aliases of aliases can make a short text arbitrarily large.
            path = self._path if self._in_file else None
            raise ConfigError([Problem(f"holds more than {MOST_VALUES} values", join_key(location[:1]), path)])
        if node in inside:
            return self._leave_out(node, location, "an alias cannot be inside its own anchor")
        if len(inside) >= MOST_LEVELS:
            return self._leave_out(node, location, "values are nested too deeply")
        inside = (*inside, node)
        if isinstance(node, MappingNode) and node.tag == _TAG + "map":
            return self._make_mapping(node, location, inside)
        if isinstance(node, SequenceNode) and node.tag == _TAG + "seq":
            items = []
            for index, item in enumerate(node.value):
                self._lines[(*location, index)] = self._find_line(item)
                items.append(self._make_plain(item, (*location, index), inside))
            return items
        try:
            return _read_scalar(node)
        except ValueError as error:
            return self._leave_out(node, location, str(error))

    def _make_mapping(self, node: MappingNode, location: Location, inside: tuple[Node, ...]) -> Any:
        values: dict[str, Any] = {}
        for key_node, value_node in node.value:
            name = key_node.value
            if key_node.tag == _TAG + "merge":
                # Without what it should bring, other keys would be reported as missing, too.
                return self._leave_out(key_node, location, _NO_MERGING)
            if not isinstance(name, str):
                self._note(key_node, location, "a key should be a word")
            elif name in values:
                first = f", first in line {self._lines[(*location, name)]}" if self._in_file else ""
                self._note(key_node, (*location, name), f"the key is here twice{first}")
            else:
                self._lines[(*location, name)] = self._find_line(key_node)
                values[name] = self._make_plain(value_node, (*location, name), inside)
        return values

    def _leave_out(self, node: Node, location: Location, sentence: str) -> None:
        self._note(node, location, sentence)
        self.left_out.add(location)

    def _note(self, node: Node, location: Location, sentence: str) -> None:
        path = self._path if self._in_file else None
        self.problems.append(Problem(sentence, join_key(location), path, self._find_line(node)))

    def _find_line(self, node: Node) -> int | None:
        return node.start_mark.line + 1 if self._in_file else None


def _read_text(path: Path) -> str:
    try:
        if not stat.S_ISREG(kind := path.stat().st_mode):
            # To read a pipe or a device may block for ever.
            got = "a directory" if stat.S_ISDIR(kind) else "a pipe or a device"
            raise ConfigError([Problem(f"should be a YAML file, got {got}", path=path)])
        if other := recognise(path):
            raise ConfigError([Problem(f"should be YAML in UTF-8, got {other}", path=path)])
        with path.open("rb") as file:
            data = file.read(_MOST_BYTES + 1)
        if len(data) > _MOST_BYTES:
            raise ConfigError([Problem(f"larger than {_MOST_BYTES} bytes", path=path)])
        return data.decode("utf-8")
    except FileNotFoundError as error:
        hint = f"{command('init')} writes one to begin with" if path == DEFAULT_CONFIG else None
        raise ConfigError([Problem(f"no such file{suggest_path(path)}", path=path)], hint=hint) from error
    except PermissionError as error:
        raise ConfigError([Problem("no permission to read the file", path=path)]) from error
    except OSError as error:
        raise ConfigError([Problem(f"cannot be read: {error.strerror}", path=path)]) from error
    except UnicodeDecodeError as error:
        line = error.object.count(b"\n", 0, error.start) + 1
        sentence = f"should be UTF-8 text, got the byte 0x{error.object[error.start]:02x}"
        raise ConfigError([Problem(sentence, path=path, line=line)]) from error
    except ValueError as error:
        # Python itself refuses some names before it asks the system, such as one with a zero byte.
        raise ConfigError([Problem("no file can have this name", path=path)]) from error


@cache
def _make_constructor() -> SafeConstructor:
    constructor: SafeConstructor = YAML(typ="safe", pure=True).constructor
    return constructor


def _read_scalar(node: Node) -> Any:
    """Read a YAML 1.2 scalar; dates and other extensions stay text."""
    constructor = _make_constructor()
    readers: dict[str, Callable[[ScalarNode], Any]] = {
        "null": lambda _: None,
        "bool": constructor.construct_yaml_bool,
        "int": constructor.construct_yaml_int,
        "float": constructor.construct_yaml_float,
        **dict.fromkeys(("str", "timestamp", "merge", "value"), lambda text: text.value),
    }
    tag = str(node.tag).removeprefix(_TAG)
    if not isinstance(node, ScalarNode) or tag not in readers:
        raise ValueError(f"the tag {tag} means nothing here")
    try:
        value = readers[tag](node)
    except (LookupError, ValueError) as error:
        # ruamel looks for certain letters and words in the text, and raises these where it does not find them.
        raise ValueError(f"{quote(node.value)} is not of the kind {tag}") from error
    if isinstance(value, int) and value.bit_length() > _MOST_BITS:
        raise ValueError("the number is too large")
    return value


def _read_index(holder: Any, part: str) -> str | int:
    return index_or_key(part) if isinstance(holder, list) else part


def _has_item(holder: Any, index: str | int) -> bool:
    if isinstance(holder, list):
        return isinstance(index, int) and index < len(holder)
    return isinstance(holder, dict) and index in holder
