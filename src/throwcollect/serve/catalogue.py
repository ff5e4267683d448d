"""The catalogue of components that clients may have instances of, from the operator's YAML file."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from pydantic import Field, PositiveInt, model_validator

from throwcollect.collect.runtimes.run_record import Kind
from throwcollect.config.document import Document
from throwcollect.config.loader import load
from throwcollect.config.run import ContainerSpec, Mount, NodeContainerConfig
from throwcollect.config.section import ContradictionError, Section
from throwcollect.errors import NotFoundError
from throwcollect.robots.appearance import read_urdf_text
from throwcollect.wording import suggest

LONGEST_NAME = 63
NAME = rf"[a-z0-9][a-z0-9_-]{{0,{LONGEST_NAME - 1}}}"
"""Names of components and ids of instances, which become names of files and containers, and parts of URLs."""
ENTRY = r"(?!\.)[A-Za-z0-9_.-]{1,80}"
"""Names of runs and models that clients may ask for; none of them is a path to another directory."""


class ComponentSection(NodeContainerConfig):
    """One component; exactly one of `config`, `session` and `image` defines its instances.

    Properties of containers are only for components that have an image.
    """

    pretty_name: str | None = None
    """The name that people see; by default, the name of the component."""
    config: str | None = None
    """Configuration of a collection; relative to the catalogue."""
    session: str | None = None
    """Configuration of simulations without a coordinator, which clients drive; relative to the catalogue."""
    max_instances: PositiveInt = 1
    """How many instances may live at once."""
    image: Annotated[str, Field(min_length=1)] | None = None
    """Image of a container, which may join a run."""
    command: list[str] | None = None
    """The command that the container runs; by default, that of the image."""
    mounts: list[Mount] = Field(default=[], alias="volumes")
    """Directories and files of the host that are mounted into the container; not below /data or /key."""
    urdf: str | None = None
    """File with the description of the robot for viewers; relative to the catalogue."""

    @model_validator(mode="after")
    def _is_one_thing(self) -> ComponentSection:
        if sum(each is not None for each in (self.config, self.session, self.image)) != 1:
            raise ValueError("should have one of config, session and image")
        given = self.model_fields_set & {*NodeContainerConfig.model_fields, "command", "urdf"}
        if self.image is None and (wrong := sorted("volumes" if each == "mounts" else each for each in given)):
            raise ContradictionError(dict.fromkeys(wrong, "should be left out; it is for components with image"))
        return self


class CatalogueFile(Section):
    """A catalogue of components."""

    components: dict[Annotated[str, Field(pattern=f"^{NAME}$")], ComponentSection] = Field(min_length=1)
    """Components by their names."""


@dataclass(frozen=True)
class Component:
    """Something that clients may have instances of.

    Attributes:
        name: Its name.
        pretty_name: The name that people see.
        kind: Whether its instances collect datasets, have simulations for clients alone, or are containers.
        source: File of the configuration; for a container, its image and options.
        max_instances: How many instances may live at once.
        urdf: File of the robot's description for viewers of a container; None if it has none.
    """

    name: str
    pretty_name: str
    kind: Kind
    source: Path | ContainerSpec
    max_instances: int
    urdf: Path | None = None


@dataclass(frozen=True)
class Catalogue:
    """All components, by their names."""

    components: Mapping[str, Component]

    def get(self, name: str) -> Component:
        """The component of a name."""
        try:
            return self.components[name]
        except KeyError:
            hint = None if self.components else "throwcollect serve CATALOG.yaml offers what is in a catalogue"
            raise NotFoundError(f"no component {name!r}{suggest(name, self.components)}", hint=hint) from None

    @classmethod
    def read(cls, path: Path) -> Catalogue:
        """Read a catalogue, or take a configuration of a collection for the only component.

        Args:
            path: YAML file with the key ``components``, or a configuration.
        """
        document = Document(path)
        if "components" not in document.values:
            config = load(path)
            return cls({config.name: Component(config.name, config.name, "collection", path.absolute(), 1)})
        sections = document.validate(CatalogueFile).components
        directory = path.absolute().parent
        return cls({name: _read_component(name, section, directory) for name, section in sections.items()})


def _read_component(name: str, section: ComponentSection, directory: Path) -> Component:
    """Make a component from its section, and check the file that the section names."""
    pretty_name = section.pretty_name or name
    if section.image is not None:
        urdf = None if section.urdf is None else directory / section.urdf
        if urdf is not None:
            read_urdf_text(urdf)
        node = NodeContainerConfig(**section.model_dump(include=set(NodeContainerConfig.model_fields)))
        source = ContainerSpec(section.image, None if section.command is None else tuple(section.command), node)
        return Component(name, pretty_name, "container", source, section.max_instances, urdf)
    config = directory / (section.config or section.session or "")
    load(config)
    kind: Kind = "collection" if section.session is None else "session"
    return Component(name, pretty_name, kind, config, section.max_instances)
