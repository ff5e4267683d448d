"""A format that datasets are exported to, how it lays them out, and the data card that describes this."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import pyarrow as pa

from throwcollect.config.schema import MOTIONS
from throwcollect.config.task_config import is_target
from throwcollect.dataset.data_card import outcome_lines
from throwcollect.dataset.directory import CONFIG, TRIALS
from throwcollect.dataset.sensors import FRAMES
from throwcollect.publish.export.throw_source import NO_IMAGES, ExportSource, choose_streams, read_metadata
from throwcollect.robots.description import robot_of
from throwcollect.version import __version__


@dataclass(frozen=True)
class Layout:
    """How a format lays its data out, in words.

    Attributes:
        files: Contents of each file or directory.
        loading: Code that loads it.
        over_time: Lines of the section on time series.
        frames: How what a sensor saw is named.
        notes: Further remarks for users, one paragraph each.
        language: Language of `loading`.
    """

    files: Mapping[str, str]
    loading: str
    over_time: Sequence[str]
    frames: str = ""
    notes: Sequence[str] = ()
    language: str = "python"


@dataclass(frozen=True)
class Exporter:
    """One format.

    Attributes:
        describe: Describes how `write` lays a source out, for the data card.
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


def render_card(source: ExportSource, layout: Layout) -> str:
    """Write the text of the README.md of an export."""
    config = source.dataset.config
    files = dict(layout.files)
    files[CONFIG] = "the configuration of the collection; collecting with it again yields the same data."
    if config.sweep.file:
        files[TRIALS] = "the list of points that the configuration reads."
    if config.task.trajectory.family == "file":
        files[MOTIONS] = "the motions of the trials."
    blocks = [
        f"# {config.name}",
        f"{len(source.table)} simulated {config.task.subject} by {robot_of(config).title}; "
        f"{len(source.throws)} of them have time series, at {source.rate_hz} Hz. "
        f"Exported by throwcollect {__version__} from the dataset with the digest `{source.dataset.digest}`.",
        "\n".join(outcome_lines(source.table)),
        "## Files",
        "\n".join(f"- `{name}`: {text}" for name, text in files.items()),
        f"```{layout.language}\n{layout.loading}\n```",
        *layout.notes,
        *_explain_samples(source, layout),
        "The world frame has x forward, y left, z up; its origin is on the ground below the robot's base.",
        "## Over time",
        "\n".join(layout.over_time),
        "## One row a trial",
        "\n".join(_list_columns(source.table)),
    ]
    return "\n\n".join(blocks)


def _explain_samples(source: ExportSource, layout: Layout) -> Iterator[str]:
    """Describe rate and targets, and what is here of what sensors saw."""
    recorded_hz, noun = source.dataset.config.record.rate_hz, source.dataset.config.task.noun
    every = f"every {recorded_hz // source.rate_hz}th of those" if source.rate_hz < recorded_hz else "those"
    yield (
        f"The samples are {every} recorded at {recorded_hz} Hz, unchanged; what is faster than "
        f"{source.rate_hz / 2:g} Hz is aliased."
    )
    if source.targets:
        names = _quote([each.name for each in source.targets])
        yield f"Every {noun} has a target, {names}, which is the same in all its samples."
    elif any(is_target(name) for name in source.table.column_names):
        yield f"Not every {noun} has a target, so targets are in the table of all trials alone."
    recorded, stored = (
        "; ".join(f"`{name}` {', '.join(streams)}" for name, streams in each.items())
        for each in (choose_streams(source.dataset.config, FRAMES), source.streams)
    )
    if recorded:
        named = f"{stored}; named {layout.frames}" if stored else "nothing"
        yield f"The sensors recorded: {recorded}. Of this, here is: {named}."


def tabulate_signals(source: ExportSource, *, columns: bool = False) -> list[str]:
    """List the signals of a source in a Markdown table, by the names of their arrays or of their columns."""
    return [
        f"| {'columns' if columns else 'array'} | unit | size | |",
        "|---|---|---|---|",
        *(
            f"| {_quote(signal.pattern.split(', ') if columns else [signal.name])} | {signal.unit} "
            f"| {len(signal.columns)} | {signal.description} |"
            for signal in source.signals
        ),
        "",
        list_joints(source, everything=True),
    ]


def list_joints(source: ExportSource, *, everything: bool = False) -> str:
    """List the joints in the order of the data, in one line."""
    joints = f"The joints that move are {_quote(source.dataset.moving_joints)}, in this order"
    return f"{joints}; all joints are {_quote(source.dataset.joints)}." if everything else f"{joints}."


def _quote(names: Sequence[str]) -> str:
    return ", ".join(f"`{name}`" for name in names)


def _list_columns(table: pa.Table) -> list[str]:
    rows = []
    for column in table.schema:
        metadata = {"unit": "", "description": "", **read_metadata(column)}
        rows.append(f"| `{column.name}` | {metadata['unit']} | {metadata['description']} |")
    return ["| column | unit | |", "|---|---|---|", *rows, ""]
