"""A format that datasets are exported to, how it lays them out, and the data card that describes this."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import pyarrow as pa

from throwcollect.config.schema import MOTIONS, Config
from throwcollect.config.task_config import is_target
from throwcollect.dataset.bag import to_yaml
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
        hub: Tags and configurations of a dataset on a hub; None if the format is not one that hubs show.
        language: Language of `loading`.
    """

    files: Mapping[str, str]
    loading: str
    over_time: Sequence[str]
    frames: str = ""
    notes: Sequence[str] = ()
    hub: Mapping[str, Any] | None = None
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
    lines = [
        *(_render_front_matter(config, layout.hub) if layout.hub else []),
        f"# {config.name}",
        "",
        f"{len(source.table)} simulated {config.task.subject} by {robot_of(config).title}; "
        f"{len(source.throws)} of them have time series, at {source.rate_hz} Hz. "
        f"Exported by throwcollect {__version__} from the dataset with the digest `{source.dataset.digest}`.",
        "",
        *outcome_lines(source.table),
        "",
        "## Files",
        "",
        *(f"- `{name}`: {text}" for name, text in layout.files.items()),
        f"- `{CONFIG}`: the configuration of the collection; collecting with it again yields the same data.",
        *([f"- `{TRIALS}`: the list of points that the configuration reads."] if config.sweep.file else []),
        *([f"- `{MOTIONS}`: the motions of the trials."] if config.task.trajectory.family == "file" else []),
        "",
        f"```{layout.language}",
        layout.loading,
        "```",
        "",
        *(
            line
            for note in (
                *layout.notes,
                _explain_rate(source),
                *_explain_targets(source),
                *_explain_sensors(source, layout),
            )
            for line in (note, "")
        ),
        "The world frame has x forward, y left, z up; its origin is on the ground below the robot's base.",
        "",
        "## Over time",
        "",
        *layout.over_time,
        "",
        "## One row a trial",
        "",
        *_list_columns(source.table),
    ]
    return "\n".join(lines)


def _render_front_matter(config: Config, hub: Mapping[str, Any]) -> list[str]:
    header = {
        "license": "apache-2.0",
        "pretty_name": config.name,
        "task_categories": ["robotics"],
        "tags": [*hub["tags"], "robotics", config.task.keyword or config.task.name, config.robot.name, "simulation"],
        "configs": hub["configs"],
    }
    return ["---", to_yaml(header) + "---", ""]


def _explain_rate(source: ExportSource) -> str:
    recorded_hz = source.dataset.config.record.rate_hz
    if source.rate_hz == recorded_hz:
        return f"The samples are those that were recorded, at {recorded_hz} Hz."
    if recorded_hz % source.rate_hz == 0:
        how = f"Each is one of the {recorded_hz} Hz record, unchanged: every {recorded_hz // source.rate_hz}th."
    else:
        how = (
            f"They lie between those of the {recorded_hz} Hz record: positions of joints and bodies on the cubic "
            "through positions and velocities of both neighbours, all else linear, orientations normalised."
        )
    return (
        f"The samples are at {source.rate_hz} Hz. {how} Nothing is filtered: what is faster than "
        f"{source.rate_hz / 2:g} Hz is aliased. Commanded values are computed at the very instants."
    )


def _explain_targets(source: ExportSource) -> list[str]:
    """Describe which trials have targets, if the dataset has some."""
    noun = source.dataset.config.task.noun
    if not any(is_target(name) for name in source.table.column_names):
        return []
    if not source.targets:
        return [f"Not every {noun} has a target, so targets are in the table of all trials alone."]
    names = _quote([each.name for each in source.targets])
    return [f"Every {noun} has a target, {names}, which is the same in all its samples, for policies to condition on."]


def _explain_sensors(source: ExportSource, layout: Layout) -> list[str]:
    """Describe what is here of what sensors saw, if the dataset has some."""
    recorded, stored = (
        "; ".join(f"`{name}` {', '.join(streams)}" for name, streams in each.items())
        for each in (choose_streams(source.dataset.config, FRAMES), source.streams)
    )
    named = f"{stored}; named {layout.frames}" if stored else "nothing"
    return [f"The sensors recorded: {recorded}. Of this, here is: {named}."] if recorded else []


def tabulate_signals(source: ExportSource, *, columns: bool = False) -> list[str]:
    """List the signals of a source in a Markdown table, by the names of their arrays or of their columns."""
    return [
        f"| {'columns' if columns else 'array'} | unit | of | |",
        "|---|---|---|---|",
        *(
            f"| {_quote(signal.pattern.split(', ') if columns else [signal.name])} | {signal.unit} | {signal.each} "
            f"| {signal.description} |"
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
