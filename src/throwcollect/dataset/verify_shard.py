"""Checks one MCAP file of a dataset: every record of it, in order, and behind a damaged one from the next chunk on."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

from isal.isal_zlib import crc32
from mcap import records
from mcap.opcode import Opcode

from throwcollect.config.schema import Config
from throwcollect.dataset.bag import FileSummary
from throwcollect.dataset.directory import THROWS
from throwcollect.dataset.findings import Finding
from throwcollect.dataset.mcap_contents import FileContents, declarations
from throwcollect.dataset.mcap_file import BAG, EPISODE, LIBRARY, MAGIC, PROFILE, bag_record, episode_index
from throwcollect.dataset.mcap_reader import McapContents, Record, StoredEpisode, mapped
from throwcollect.episode.channels import ROBOT_DESCRIPTION_ID, Channels
from throwcollect.episode.chunk import Chunk, MessageTable, encode_records
from throwcollect.errors import DatasetError, ThrowcollectError
from throwcollect.interfaces import deserialize, get_message
from throwcollect.robots.description import full_description

_CRC_BLOCK = 1 << 20
_MOST_DAMAGES = 100
"""Damaged stretches of one file that are told one by one."""
_FOOTER = encode_records(records.Footer(0, 0, 0))

Problems = Callable[[StoredEpisode, str, Channels | None], Iterator[str]]
"""What is wrong with an episode of the file of this name, recorded on these channels."""


class ShardCheck:
    """Checks one file; afterwards it holds what was found.

    Attributes:
        findings: What is wrong.
        summary: What the bag's metadata should say of the file; None if not all of it could be read.
        channels: What it records; None if that is not known.
        digests: Digest of each episode that could be read, by trial.

    Args:
        path: The file.
        config: Configuration of the dataset; None if it is not known.
        trials: Trials whose episodes the file should hold, in order; None if they are not known.
        problems: Finds what is wrong with an episode.
    """

    def __init__(self, path: Path, config: Config | None, trials: Sequence[int] | None, problems: Problems) -> None:
        self.findings: list[Finding] = []
        self.summary: FileSummary | None = None
        self.channels: Channels | None = None
        self.digests: dict[int, str] = {}
        self._path = path
        self._config = config
        self._waiting = None if trials is None else list(trials)
        self._problems = problems
        self._damages = 0
        try:
            with mapped(path) as contents:
                self._check(contents)
        except ThrowcollectError as error:
            self._report("", str(error).removeprefix(f"{path}: "))

    def _report(self, place: str, problem: str) -> None:
        self.findings.append(Finding(self._path.name, place, problem))

    def _report_damage(self, error: DatasetError, *, start: int | None = None, resumed: int = -1) -> None:
        """Report that records cannot be read.

        Args:
            error: Says why.
            start: Where the run of records begins that is damaged, if it is not where the error says [bytes].
            resumed: Where the next one begins [bytes]; -1 if there is none.
        """
        self._damages += 1
        place, colon, problem = str(error).partition(": ")
        if not colon or not place.startswith("byte ") or start not in (None, int(place.removeprefix("byte "))):
            place, problem = "" if start is None else f"byte {start}", str(error)
        self._report(place, problem + (f"; the next episode is at byte {resumed}" if resumed >= 0 else ""))

    def _check(self, contents: McapContents) -> None:
        if len(contents) < len(MAGIC):
            raise DatasetError(f"has {len(contents)} bytes: the file is cut off")
        if contents.slice(0, len(MAGIC)) != MAGIC:
            self._report("byte 0", "the file does not begin as an MCAP file does")
        held = FileContents([], [])
        offset = self._check_opening(contents, held)
        latched_ns = None
        try:
            if offset >= 0:
                latched_ns, offset = self._check_latched(contents, contents.record(offset), held)
        except DatasetError as error:
            self._report_damage(error)
            offset = contents.next_chunk(offset + 1)
        if self.channels is None and self._config is not None:
            self.channels = Channels(self._config, full_description(self._config))
        if not self._damages:
            self._check_declarations(held)
        end = self._check_episodes(contents, offset, held, latched_ns)
        for trial in self._waiting or ():
            self._report(f"trial {trial}", f"{THROWS} places an episode here, but the file has no whole one")
        try:
            if self._damages:
                self._check_footer(contents)
            else:
                self._check_end(contents, end, held)
        except DatasetError as error:
            self._report_damage(error)

    def _check_opening(self, contents: McapContents, held: FileContents) -> int:
        """Check all before the first chunk; returns where that begins, -1 if nowhere."""
        try:
            header = contents.record(len(MAGIC))
            if header.data != encode_records(records.Header(PROFILE, LIBRARY)):
                place = f"byte {header.offset}"
                self._report(place, f"header is not that of a file with profile {PROFILE} by {LIBRARY}")
            for record in contents.records(header.end):
                if record.opcode == Opcode.SCHEMA:
                    held.schemas.append(record.parse(records.Schema))
                elif record.opcode == Opcode.CHANNEL:
                    held.channels.append(record.parse(records.Channel))
                elif record.opcode == Opcode.CHUNK:
                    return record.offset
                else:
                    raise DatasetError(f"byte {record.offset}: a {record.kind} before the first chunk")
        except DatasetError as error:
            self._report_damage(error)
        return contents.next_chunk(0)

    def _check_declarations(self, held: FileContents) -> None:
        if self.channels is None:
            return
        schemas, channels = declarations(self.channels.all)
        for wanted in schemas:
            found = next((each for each in held.schemas if each.id == wanted.id), None)
            if found != wanted:
                self._report("schemas", f"that of {wanted.name} is {'missing' if found is None else 'another one'}")
        if len(held.schemas) > len(schemas):
            self._report(
                "schemas", f"are {[each.name for each in held.schemas]}, not {[each.name for each in schemas]}"
            )
        if held.channels != channels:
            wrong = [each.topic for each in held.channels if each not in channels] or "missing"
            self._report("channels", f"are not those of the configuration: {wrong}")

    def _check_latched(self, contents: McapContents, record: Record, held: FileContents) -> tuple[int | None, int]:
        """Check the first chunk; returns the time of its messages [ns], if known, and where the next record begins."""
        place = f"byte {record.offset}"
        try:
            chunk = Chunk.parse(record.data)
        except DatasetError as error:
            raise DatasetError(f"{place}: latched topics: {error}") from error
        found, following = contents.message_indexes(record.end)
        indexes = {channel: each.data for channel, each in found.items()}
        if following.opcode == Opcode.METADATA and following.parse(records.Metadata).name == EPISODE:
            self._report_damage(DatasetError(f"{place}: latched topics: missing, an episode is here"))
            return None, record.offset
        held.add_chunk(episode_index(chunk, indexes), record.offset, 1)
        try:
            table = MessageTable(chunk.decompress(), 1)
        except DatasetError as error:
            self._report(place, f"latched topics: {error}")
            return None, following.offset
        stamp = int(table.log_times[0])
        if b"".join(indexes.values()) != b"".join(map(table.message_index, table.columns)):
            self._report(place, "the message indexes of the latched topics do not fit their chunk")
        if list(table.columns) != [channel.id for channel in Channels.latched]:
            self._report(place, f"latched topics: the file begins with channels {list(table.columns)}")
        elif self._config is not None:
            self._check_description(self._config, table, place)
        if (chunk.start_ns, chunk.end_ns) != (stamp, stamp):
            self._report(place, "latched topics: times of the chunk differ from those of its messages")
        return stamp, following.offset

    def _check_description(self, config: Config, table: MessageTable, place: str) -> None:
        text = table.messages(ROBOT_DESCRIPTION_ID)[0].tobytes()
        try:
            self.channels = Channels(config, deserialize(text, get_message("std_msgs/msg/String")).data)
            messages = self.channels.latched_messages(int(table.log_times[0]))
        except (ValueError, ThrowcollectError) as error:
            self._report(place, f"latched topics: /robot_description is not readable: {error}")
            return
        for channel, message in messages.items():
            if table.messages(channel.id)[0].tobytes() != message:
                self._report(place, f"latched topics: {channel.topic} does not fit the robot's description")

    def _check_episodes(self, contents: McapContents, offset: int, held: FileContents, latched_ns: int | None) -> int:
        """Check all episodes; returns where the record after the last of them begins, -1 if that is not known."""
        places: dict[int, int] = {}
        while offset >= 0:
            try:
                record = contents.record(offset)
                if record.opcode == Opcode.METADATA and record.parse(records.Metadata).name == BAG:
                    return offset
                stored = contents.episode(offset)
                self._hold(stored, held)
            except DatasetError as error:
                if self._damages >= _MOST_DAMAGES:
                    self._report(f"byte {offset}", "so much is damaged that the rest is not looked at")
                    return -1
                start, offset = offset, contents.next_chunk(offset + 1)
                self._report_damage(error, start=start, resumed=offset)
                continue
            if not places and latched_ns not in (None, stored.episode.header.start_ns):
                said = f"starts at {stored.episode.header.start_ns} ns, the latched topics at {latched_ns} ns"
                self._report(f"trial {stored.episode.header.trial}", said)
            self._check_place(stored, places)
            offset = stored.facts.end
        return -1

    def _hold(self, stored: StoredEpisode, held: FileContents) -> None:
        lengths = {channel: record.data for channel, record in stored.indexes.items()}
        index = episode_index(stored.episode.chunk, lengths)
        held.add_chunk(index, stored.chunk.offset, stored.episode.header.samples)
        held.add_metadata(EPISODE, stored.facts.offset, len(stored.facts.data))

    def _check_place(self, stored: StoredEpisode, places: dict[int, int]) -> None:
        """Check an episode, and that it is the one that should come now; `places` are those of earlier ones [bytes]."""
        trial, offset = stored.episode.header.trial, stored.chunk.offset
        place = f"trial {trial}"
        if trial in places:
            self._report(
                place, f"byte {offset}: the file has an episode of this trial already, at byte {places[trial]}"
            )
        elif self._waiting is not None and trial not in self._waiting:
            self._report(place, f"byte {offset}: an episode that {THROWS} does not place here")
        else:
            if places and trial < max(places):
                self._report(place, f"byte {offset}: comes after trial {max(places)}")
            for problem in self._problems(stored, self._path.name, self.channels):
                self._report(place, problem)
            self.digests[trial] = stored.episode.digest
            if self._waiting is not None:
                self._waiting.remove(trial)
        places.setdefault(trial, offset)

    def _check_end(self, contents: McapContents, offset: int, held: FileContents) -> None:
        bag = contents.record(offset)
        summary = held.summary(self._path.name)
        if self.channels is not None and bag.data != encode_records(bag_record(summary, self.channels.all)):
            self._report(f"byte {offset}", f"the copy of the bag's metadata ({BAG}) does not fit the file")
        held.add_metadata(BAG, bag.offset, len(bag.data))
        end = contents.record(bag.end)
        if end.opcode != Opcode.DATA_END:
            raise DatasetError(f"byte {end.offset}: a {end.kind} where the data section should end")
        if end.data != encode_records(records.DataEnd(_crc(contents, 0, end.offset))):
            self._report(f"byte {end.offset}", "the CRC of the data section differs from its contents")
        self._check_summary(contents, end.end, held)
        self.summary = summary

    def _check_summary(self, contents: McapContents, start: int, held: FileContents) -> None:
        section = held.section(start)
        expected = McapContents(section).records(0)
        for actual in contents.records(start):
            wanted = next(expected, None)
            if wanted is None or actual.opcode != wanted.opcode:
                due = "nothing" if wanted is None else f"a {wanted.kind}"
                self._report(f"byte {actual.offset}", f"summary: a {actual.kind} where {due} should be")
                break
            if actual.data != wanted.data:
                self._report(f"byte {actual.offset}", f"summary: the {actual.kind} does not fit the file")
        else:
            for wanted in expected:
                self._report("summary", f"a {wanted.kind} is missing")
        self._check_magic(contents)
        if len(contents) != start + len(section) + len(MAGIC):
            self._report("", f"has {len(contents)} bytes, its records have {start + len(section) + len(MAGIC)}")

    def _check_magic(self, contents: McapContents) -> bool:
        ends = contents.slice(len(contents) - len(MAGIC), len(contents)) == MAGIC
        if not ends:
            self._report(f"byte {len(contents) - len(MAGIC)}", "the file does not end as an MCAP file does")
        return ends

    def _check_footer(self, contents: McapContents) -> None:
        """Check the summary by its CRC alone, as it is not known what it should say."""
        if not self._check_magic(contents) or len(contents) < len(MAGIC) + len(_FOOTER):
            return
        footer = contents.record(len(contents) - len(MAGIC) - len(_FOOTER))
        if footer.opcode != Opcode.FOOTER or len(footer.data) != len(_FOOTER):
            raise DatasetError(f"byte {footer.offset}: a {footer.kind} where the footer should be")
        said = footer.parse(records.Footer)
        if said.summary_crc != _crc(contents, said.summary_start, footer.end - 4):
            self._report(f"byte {footer.offset}", "summary: its CRC differs from its contents")


def _crc(contents: McapContents, start: int, end: int) -> int:
    crc = 0
    for block in range(start, end, _CRC_BLOCK):
        crc = crc32(contents.slice(block, min(block + _CRC_BLOCK, end)), crc)
    return crc
