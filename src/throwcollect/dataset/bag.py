"""metadata.yaml of a rosbag2 bag, version 9, as rosbag2 writes and reads it.

Fields and their order are those of ``rosbag2_storage/yaml.hpp`` (ROS 2 Jazzy and later).
"""

from __future__ import annotations

import io
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

from ruamel.yaml import YAML
from ruamel.yaml.composer import Composer, ComposerError
from ruamel.yaml.error import YAMLError
from ruamel.yaml.events import AliasEvent

from rclzenoh.interfaces import type_hash
from throwcollect.config.document import explain_yaml_error
from throwcollect.dataset.directory import METADATA, PLAN, describe_other, is_begun
from throwcollect.dataset.lock import is_locked
from throwcollect.episode.channels import Channel
from throwcollect.errors import DatasetError
from throwcollect.files import read_text
from throwcollect.wording import command

VERSION = 9
BAG_SECTION = "rosbag2_bagfile_information"
"""The only section of the file."""
_MOST_BYTES = 10_000_000
MOST_FILES = 30_000
"""Most files of a bag: with the longest names, their metadata then just stay below the size that `from_yaml` reads."""
_ROS_DISTRO = "jazzy"
"""Release whose interface definitions the messages follow."""


@dataclass(frozen=True)
class FileSummary:
    """What a bag's metadata state of one file: its name, and the times of its first and last message [ns].

    Attributes:
        counts: Number of messages of each channel, by the channel's number.
    """

    path: str
    start_ns: int
    end_ns: int
    counts: Mapping[int, int]

    @property
    def messages(self) -> int:
        """Number of messages."""
        return sum(self.counts.values())


def bag_information(
    files: Sequence[FileSummary], channels: Sequence[Channel], custom_data: Mapping[str, str]
) -> dict[str, Any]:
    """Make the fields of the metadata of a bag with these files, in order; rosbag2 does not read `custom_data`."""
    start = min((file.start_ns for file in files), default=0)
    end = max((file.end_ns for file in files), default=0)
    return {
        "version": VERSION,
        "storage_identifier": "mcap",
        "duration": {"nanoseconds": end - start},
        "starting_time": {"nanoseconds_since_epoch": start},
        "message_count": sum(file.messages for file in files),
        "topics_with_message_count": [
            {
                "topic_metadata": {
                    "name": channel.topic,
                    "type": channel.type_name,
                    "serialization_format": "cdr",
                    "offered_qos_profiles": [channel.qos.profile],
                    "type_description_hash": type_hash(channel.type_name),
                },
                "message_count": sum(file.counts.get(channel.id, 0) for file in files),
            }
            for channel in channels
        ],
        # This means rosbag2's own compression, of messages or files, and not the compression of chunks in MCAP files.
        "compression_format": "",
        "compression_mode": "",
        "relative_file_paths": [file.path for file in files],
        "files": [
            {
                "path": file.path,
                "starting_time": {"nanoseconds_since_epoch": file.start_ns},
                "duration": {"nanoseconds": file.end_ns - file.start_ns},
                "message_count": file.messages,
            }
            for file in files
        ],
        "custom_data": dict(custom_data),
        "ros_distro": _ROS_DISTRO,
    }


class _PlainComposer(Composer):
    """Refuses aliases, with which a short text can expand without limit."""

    def compose_node(self, parent: Any, index: Any) -> Any:
        event = self.parser.peek_event()
        if isinstance(event, AliasEvent):
            raise ComposerError(problem="an alias", problem_mark=event.start_mark)
        return super().compose_node(parent, index)


def from_yaml(path: Path) -> Mapping[str, Any]:
    """Read a YAML file such as `to_yaml` makes: one mapping, without aliases."""
    try:
        document = _parse(read_text(path, most_bytes=_MOST_BYTES))
    except (YAMLError, RecursionError, ValueError) as error:
        # The library's own text shows lines of the file, in a paragraph that looks like no other message.
        reason, line = explain_yaml_error(error)
        place = "" if line is None else f"line {line}"
        raise DatasetError(f"cannot be read: {reason}", path=path, place=place) from error
    return document if isinstance(document, dict) else {}


@lru_cache(maxsize=8)
def _parse(text: str) -> Any:
    """Parse YAML; the last strings are cached, because one command reads the metadata of a dataset several times."""
    yaml = YAML(typ="safe", pure=True)
    yaml.Composer = _PlainComposer
    return yaml.load(text)


def read_bag_metadata(directory: Path) -> Mapping[str, Any]:
    """Read the fields of the rosbag2 metadata of a finished dataset."""
    refuse_other_directory(directory)
    path = directory / METADATA
    if not path.exists():
        if (directory / PLAN).is_file():
            # On file systems without locks, a run that works on it goes unnoticed.
            busy = is_locked(directory)
            state = "is being collected" if busy else "is not finished"
            hint = command("wait", "--run", directory) if busy else command("resume", directory)
            raise DatasetError(f"the dataset {state}: it has no {METADATA}", path=directory, hint=hint)
        raise DatasetError("holds no dataset", path=directory)
    bag = from_yaml(path).get(BAG_SECTION)
    if not isinstance(bag, dict):
        raise DatasetError("not the metadata of a rosbag2 bag", path=path)
    return bag


def refuse_other_directory(directory: Path) -> None:
    """Refuse a directory without any file of a dataset, as advice on damaged datasets would not help there."""
    if not is_begun(directory):
        raise DatasetError(describe_other(directory), path=directory)


def to_yaml(data: Mapping[str, Any]) -> str:
    """Encode a mapping of plain values as YAML in block style, with the keys in their order."""
    yaml = YAML()
    # By default, long values would be broken at 80 characters.
    yaml.width = 4096
    # A value that occurs twice, such as an infinite duration, would be an alias, which `from_yaml` refuses.
    yaml.representer.ignore_aliases = lambda *_: True
    stream = io.StringIO()
    yaml.dump(data, stream)
    return stream.getvalue()
