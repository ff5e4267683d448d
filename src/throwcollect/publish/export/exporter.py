"""The parts of a format that datasets are exported to."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path

from throwcollect.publish.export.readme import Layout
from throwcollect.publish.export.throw_source import NO_IMAGES, ExportSource


@dataclass(frozen=True)
class Exporter:
    """One format.

    Attributes:
        describe: Says how `write` lays a source out, for the data card.
        write: Writes the data files of a source into a directory that exists and is empty. It raises a `ConfigError` if
            the format does not suit the dataset, a `DatasetError` if an episode is damaged or a file would be too large
            for the format, and an `OSError` if a file cannot be written.
        packages: Packages of the extra ``export`` that the format needs, by their names in imports.
        images: Ways of storing what sensors saw, the usual one first, with the streams that each stores.
    """

    describe: Callable[[ExportSource], Layout]
    write: Callable[[ExportSource, Path], None]
    packages: tuple[str, ...] = ()
    images: Mapping[str, tuple[str, ...]] = field(default_factory=lambda: {NO_IMAGES: ()})
