"""Checks one MCAP file of a dataset: every record of it, in order."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from isal.isal_zlib import crc32
from mcap import records
from mcap.opcode import Opcode

from throwcollect.config.schema import Config
from throwcollect.dataset.bag import FileSummary
from throwcollect.dataset.findings import Finding
from throwcollect.dataset.mcap_contents import FileContents, declarations
from throwcollect.dataset.mcap_file import BAG, EPISODE, LIBRARY, MAGIC, PROFILE, bag_record, episode_index
from throwcollect.dataset.mcap_reader import McapContents, Record, StoredEpisode, opened
from throwcollect.episode.channels import ROBOT_DESCRIPTION_ID, Channels
from throwcollect.episode.chunk import Chunk, MessageTable, encode_records
from throwcollect.errors import ThrowcollectError
from throwcollect.interfaces import deserialize, get_message

_CRC_BLOCK = 1 << 20

Problems = Callable[[StoredEpisode, Mapping[str, Any], Channels], Iterator[str]]
"""What is wrong with an episode that has this row, recorded on these channels."""


class ShardCheck:
    """Checks one file; afterwards it holds what was found.

    Attributes:
        findings: What is wrong.
        summary: What the bag's metadata should say of the file; None if it could not be read to its end.
        channels: What it records; None if that could not be read.
        digests: Digest of each episode that could be read, by trial.

    Args:
        path: The file.
        config: Configuration of the dataset.
        rows: Rows of the trials whose episodes it should hold, in order.
        problems: Finds what is wrong with an episode.
    """

    def __init__(self, path: Path, config: Config, rows: Sequence[Mapping[str, Any]], problems: Problems) -> None:
        self.findings: list[Finding] = []
        self.summary: FileSummary | None = None
        self.channels: Channels | None = None
        self.digests: dict[int, str] = {}
        self._path = path
        self._config = config
        self._rows = {row["trial"]: row for row in rows}
        self._problems = problems
        try:
            with opened(path) as contents:
                self._check(contents)
        except ThrowcollectError as error:
            self._report("", str(error).removeprefix(f"{path}: "))

    def _report(self, place: str, problem: str) -> None:
        self.findings.append(Finding(self._path.name, place, problem))

    def _check(self, contents: McapContents) -> None:
        header = contents.record(len(MAGIC))
        self._check_header(header)
        schemas: list[records.Schema] = []
        channels: list[records.Channel] = []
        record = contents.record(header.end)
        while record.opcode in (Opcode.SCHEMA, Opcode.CHANNEL):
            if record.opcode == Opcode.SCHEMA:
                schemas.append(record.parse(records.Schema))
            else:
                channels.append(record.parse(records.Channel))
            record = contents.record(record.end)
        held = FileContents(schemas, channels)
        latched, offset = self._check_latched(contents, record, held)
        self._check_declarations(held)
        offset = self._check_episodes(contents, offset, held, latched)
        self._check_end(contents, offset, held)

    def _check_header(self, record: Record) -> None:
        expected = records.Header(PROFILE, LIBRARY)
        if record.data != encode_records(expected):
            self._report(f"byte {record.offset}", f"header is not that of a file with profile {PROFILE} by {LIBRARY}")

    def _check_declarations(self, held: FileContents) -> None:
        if self.channels is None:
            return
        schemas, channels = declarations(self.channels.all)
        if [(each.id, each.name, each.encoding) for each in held.schemas] != [
            (each.id, each.name, each.encoding) for each in schemas
        ]:
            self._report(
                "schemas", f"are {[each.name for each in held.schemas]}, not {[each.name for each in schemas]}"
            )
        if held.channels != channels:
            wrong = [each.topic for each in held.channels if each not in channels] or "missing"
            self._report("channels", f"are not those of the configuration: {wrong}")

    def _check_latched(self, contents: McapContents, record: Record, held: FileContents) -> tuple[int, int]:
        """Check the first chunk; returns the time of its messages [ns] and where the next record begins."""
        chunk = Chunk.parse(record.data)
        place = f"byte {record.offset}"
        table = MessageTable(chunk.decompress(), 1)
        stamp = int(table.log_times[0])
        indexes = [table.message_index(channel) for channel in table.columns]
        held.add_chunk(episode_index(chunk, dict(zip(table.columns, indexes, strict=True))), record.offset, 1)
        end = record.end + sum(map(len, indexes))
        if contents.slice(record.end, end) != b"".join(indexes):
            self._report(place, "the message indexes of the latched topics do not fit their chunk")
        if list(table.columns) != [channel.id for channel in Channels.latched]:
            self._report(place, f"latched topics: the file begins with channels {list(table.columns)}")
            return stamp, end
        try:
            description = deserialize(
                table.messages(ROBOT_DESCRIPTION_ID)[0].tobytes(), get_message("std_msgs/msg/String")
            )
            self.channels = Channels(self._config, description.data)
        except (ValueError, ThrowcollectError) as error:
            self._report(place, f"latched topics: /robot_description is not readable: {error}")
            return stamp, end
        for channel, message in self.channels.latched_messages(stamp).items():
            if table.messages(channel.id)[0].tobytes() != message:
                self._report(place, f"latched topics: {channel.topic} does not fit the robot's description")
        if (chunk.start_ns, chunk.end_ns) != (stamp, stamp):
            self._report(place, "latched topics: times of the chunk differ from those of its messages")
        return stamp, end

    def _check_episodes(self, contents: McapContents, offset: int, held: FileContents, latched_ns: int) -> int:
        """Check all episodes; returns where the record after the last of them begins."""
        waiting = list(self._rows)
        while contents.record(offset).opcode == Opcode.CHUNK:
            stored = contents.episode(offset)
            header = stored.episode.header
            if not self.digests and header.start_ns != latched_ns:
                self._report(
                    f"trial {header.trial}", f"starts at {header.start_ns} ns, the latched topics at {latched_ns} ns"
                )
            if header.trial not in waiting:
                self._report(
                    f"trial {header.trial}", f"byte {offset}: an episode that throws.parquet does not place here"
                )
            elif waiting[0] != header.trial:
                self._report(f"trial {header.trial}", f"byte {offset}: comes before trial {waiting[0]}")
            self._check_episode(stored, held)
            waiting = [trial for trial in waiting if trial != header.trial]
            offset = stored.facts.end
        for trial in waiting:
            self._report(f"trial {trial}", "throws.parquet places an episode here, but the file has none")
        return offset

    def _check_episode(self, stored: StoredEpisode, held: FileContents) -> None:
        trial = stored.episode.header.trial
        lengths = {record.parse(records.MessageIndex).channel_id: record.data for record in stored.indexes}
        index = episode_index(stored.episode.chunk, lengths)
        held.add_chunk(index, stored.chunk.offset, stored.episode.header.samples)
        held.add_metadata(EPISODE, stored.facts.offset, len(stored.facts.data))
        if trial in self._rows and self.channels is not None:
            for problem in self._problems(stored, self._rows[trial], self.channels):
                self._report(f"trial {trial}", problem)
        self.digests[trial] = stored.episode.digest

    def _check_end(self, contents: McapContents, offset: int, held: FileContents) -> None:
        bag = contents.record(offset)
        summary = held.summary(self._path.name)
        if self.channels is not None:
            expected = encode_records(bag_record(summary, self.channels.all))
            if bag.data != expected:
                self._report(f"byte {offset}", f"the copy of the bag's metadata ({BAG}) does not fit the file")
        held.add_metadata(BAG, bag.offset, len(bag.data))
        end = contents.record(bag.end)
        crc = 0
        for start in range(0, end.offset, _CRC_BLOCK):
            crc = crc32(contents.slice(start, min(start + _CRC_BLOCK, end.offset)), crc)
        if end.data != encode_records(records.DataEnd(crc)):
            self._report(f"byte {end.offset}", "the CRC of the data section differs from its contents")
        self._check_summary(contents, end.end, held)
        self.summary = summary

    def _check_summary(self, contents: McapContents, start: int, held: FileContents) -> None:
        section = held.section(start)
        expected = McapContents(section).records(0)
        for actual in contents.records(start):
            wanted = next(expected, None)
            if wanted is None or actual.data != wanted.data:
                self._report(f"byte {actual.offset}", f"summary: the {actual.kind} does not fit the file")
        for wanted in expected:
            self._report("summary", f"a {wanted.kind} is missing")
        if contents.slice(len(contents) - len(MAGIC), len(contents)) != MAGIC:
            self._report(f"byte {len(contents) - len(MAGIC)}", "the file does not end as an MCAP file does")
        elif len(contents) != start + len(section) + len(MAGIC):
            self._report("", f"has {len(contents)} bytes, its records have {start + len(section) + len(MAGIC)}")
