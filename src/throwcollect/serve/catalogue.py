"""The catalogue of components: what clients may have instances of, as the operator's YAML file says."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

from pydantic import AfterValidator, Field, PositiveInt, ValidationError, model_validator

from throwcollect.config.document import Document
from throwcollect.config.loader import load
from throwcollect.config.problems import Finding, findings
from throwcollect.config.section import Section
from throwcollect.config.shape import Shape
from throwcollect.errors import ConfigError, NotFoundError

NAME = r"[a-z0-9][a-z0-9_-]{0,62}"
"""What names of components and ids of instances look like: words that files, URLs and containers can be named with."""


def _name(text: str) -> str:
    if not re.fullmatch(NAME, text):
        raise ValueError(f"should be at most 63 of a-z, 0-9, - and _, got '{text}'")
    return text


Name = Annotated[str, AfterValidator(_name)]


class ComponentSection(Section):
    """One component; exactly one of `config` and `session` says what its instances are."""

    pretty_name: str | None = None
    """What people are shown; the name by default."""
    config: str | None = None
    """Configuration of a collection; relative to the catalogue."""
    session: str | None = None
    """Configuration of simulations without a coordinator, for clients by hand; relative to the catalogue."""
    max_instances: PositiveInt = 1
    """How many instances may live at once."""

    @model_validator(mode="after")
    def _is_one_thing(self) -> ComponentSection:
        if (self.config is None) == (self.session is None):
            raise ValueError("should have one of config and session")
        return self


class CatalogueFile(Section):
    """A catalogue of components."""

    components: dict[Name, ComponentSection] = Field(min_length=1)
    """Components by their names."""


@dataclass(frozen=True)
class Component:
    """What clients may have instances of.

    Attributes:
        name: Its name.
        pretty_name: What people are shown.
        kind: Whether its instances collect datasets, or have simulations for clients alone.
        config: The configuration's file.
        max_instances: How many instances may live at once.
    """

    name: str
    pretty_name: str
    kind: Literal["collection", "session"]
    config: Path
    max_instances: int


@dataclass(frozen=True)
class Catalogue:
    """All components, by their names."""

    components: Mapping[str, Component]

    def get(self, name: str) -> Component:
        """The component of a name.

        Raises:
            NotFoundError: If there is none.
        """
        try:
            return self.components[name]
        except KeyError:
            known = f"one of {', '.join(self.components)}" if self.components else None
            hint = None if known else "throwcollect serve CATALOG.yaml offers what is in a catalogue"
            raise NotFoundError(f"no component {name!r}", expected=known, hint=hint) from None

    @classmethod
    def find(cls, path: Path) -> Catalogue:
        """Read a catalogue if there is one; else runs can be looked at, and none can be begun.

        Raises:
            ConfigError: As `read`.
        """
        return cls.read(path) if path.exists() else cls({})

    @classmethod
    def read(cls, path: Path) -> Catalogue:
        """Read a catalogue, or take a configuration of a collection for the only component.

        Args:
            path: YAML file with the key ``components``, or a configuration.

        Raises:
            ConfigError: If it cannot be read or anything in it is wrong, or in a configuration that it names.
        """
        document = Document(path)
        if "components" not in document.values:
            config = load(path)
            return cls({config.name: Component(config.name, config.name, "collection", path.absolute(), 1)})
        try:
            found = CatalogueFile.model_validate(document.values, strict=True)
        except ValidationError as error:
            problems = [document.problem(each.location, each.sentence) for each in _find(error, document)]
            raise ConfigError([*document.problems, *problems]) from error
        if document.problems:
            raise ConfigError(document.problems)
        components = {}
        for name, section in found.components.items():
            kind: Literal["collection", "session"] = "collection" if section.session is None else "session"
            named = path.absolute().parent / (section.config or section.session or "")
            try:
                load(named)
            except ConfigError as error:
                key = "config" if kind == "collection" else "session"
                problem = document.problem(("components", name, key), "names a file with errors")
                raise ConfigError([problem, *error.problems], hint=error.hint) from error
            components[name] = Component(name, section.pretty_name or name, kind, named, section.max_instances)
        return cls(components)


def _find(error: ValidationError, document: Document) -> list[Finding]:
    """What is wrong in a catalogue."""
    components = {"type": "object", "additionalProperties": ComponentSection.model_json_schema()}
    return findings(error, document.values, shape=Shape({"type": "object", "properties": {"components": components}}))
