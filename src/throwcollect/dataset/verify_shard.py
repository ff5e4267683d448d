"""Checks one MCAP file of a dataset: that it is, byte for byte, what its episodes call for.

The episodes are found by `scan`. All else in the file follows from them and from what is recorded, so it is written
once more, as the writer of the file does, and compared record by record.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

from isal.isal_zlib import crc32
from mcap import records
from mcap.opcode import Opcode

from throwcollect.config.schema import Config
from throwcollect.dataset.bag import FileSummary
from throwcollect.dataset.directory import THROWS
from throwcollect.dataset.findings import Finding
from throwcollect.dataset.mcap_file import BAG, LIBRARY, MAGIC, PROFILE, McapFile
from throwcollect.dataset.mcap_reader import McapContents, Record, StoredEpisode, map_file, read_latched_table
from throwcollect.dataset.scan import scan
from throwcollect.episode.channels import Channels
from throwcollect.episode.chunk import encode_records
from throwcollect.errors import DatasetError, MemberError, ThrowcollectError
from throwcollect.robots.description import full_description

_CRC_BLOCK = 1 << 20
_FOOTER = encode_records(records.Footer(0, 0, 0))
_PROBLEMS = {
    Opcode.HEADER: f"header is not that of a file with profile {PROFILE} by {LIBRARY}",
    Opcode.MESSAGE_INDEX: "the message indexes of the latched topics do not fit their chunk",
    Opcode.METADATA: f"the copy of the bag's metadata ({BAG}) does not fit the file",
    Opcode.DATA_END: "the CRC of the data section differs from its contents",
}
"""The problem with a record of this kind that differs from the one that should be there."""

FindProblems = Callable[[StoredEpisode, str, Channels | None], Iterator[str]]
"""Finds what is wrong with an episode of the file of this name, recorded on these channels."""


@dataclass
class ShardReport:
    """What was found in a file.

    Attributes:
        findings: What is wrong.
        summary: What the bag's metadata should say of the file; None if not all of it could be read, or it is not known
            what it should be.
        channels: What it records; None if that is not known.
        digests: Digest of each episode that could be read, by trial.
    """

    findings: list[Finding] = field(default_factory=list)
    summary: FileSummary | None = None
    channels: Channels | None = None
    digests: dict[int, str] = field(default_factory=dict)


def check_shard(
    path: Path, config: Config | None, trials: Sequence[int] | None, find_problems: FindProblems
) -> ShardReport:
    """Check one file.

    Args:
        path: The file.
        config: Configuration of the dataset; None if it is not known, and then only episodes and checksums are checked.
        trials: Trials whose episodes the file should hold, in order; None if they are not known.
        find_problems: Finds what is wrong with an episode.
    """
    return _ShardCheck(path, config, trials, find_problems).run()


class _ShardCheck:
    """Checks one file once; see `check_shard`."""

    def __init__(
        self, path: Path, config: Config | None, trials: Sequence[int] | None, find_problems: FindProblems
    ) -> None:
        self._result = ShardReport()
        self._path = path
        self._config = config
        self._waiting = None if trials is None else list(trials)
        self._find_problems = find_problems
        self._damaged = False
        self._expected = bytearray()
        self._model: McapFile | None = None

    def run(self) -> ShardReport:
        """Check the file and return the findings; everything that is wrong with it is one, and never an error.

        Raises:
            MemberError: If the task is of another package and fails; that says nothing of the file.
        """
        try:
            with map_file(self._path) as contents:
                self._check(contents)
        except DatasetError as error:
            self._report(error.place, error.details)
        except MemberError:
            raise
        except ThrowcollectError as error:
            self._report("", str(error))
        return self._result

    def _report(self, place: str, problem: str) -> None:
        self._result.findings.append(Finding(self._path.name, place, problem))

    def _report_damage(self, error: DatasetError, *, start: int | None = None, resumed: int = -1) -> None:
        """Report that records cannot be read.

        Args:
            error: The reason.
            start: Where the damaged run of records begins [bytes], if it is not where the error says.
            resumed: Where the next one begins [bytes]; -1 if there is none.
        """
        self._damaged = True
        place = error.place if start is None else f"byte {start}"
        problem = error.details if error.place == place else f"{error.place}: {error.details}"
        self._report(place, problem + (f"; the next episode is at byte {resumed}" if resumed >= 0 else ""))

    def _check(self, contents: McapContents) -> None:
        if len(contents) < len(MAGIC):
            raise DatasetError(f"has {len(contents)} bytes: the file is cut off")
        if contents.slice(0, len(MAGIC)) != MAGIC:
            self._report("byte 0", "the file does not begin as an MCAP file does")
        start = self._check_opening(contents)
        end = self._check_episodes(contents, start)
        for trial in self._waiting or ():
            self._report(f"trial {trial}", f"{THROWS} places an episode here, but the file has no whole one")
        try:
            if self._damaged or self._model is None:
                self._check_footer(contents)
            else:
                # From here on, the model writes what follows the last episode.
                self._expected.clear()
                summary = self._model.finish(self._path.name)
                self._compare(contents, end, bytes(self._expected[: -len(MAGIC)]))
                self._check_magic(contents)
                if len(contents) != self._model.size:
                    self._report("", f"has {len(contents)} bytes, its records have {self._model.size}")
                self._result.summary = summary
        except DatasetError as error:
            self._report_damage(error)

    def _check_opening(self, contents: McapContents) -> int:
        """Check everything before the first episode; returns where that should begin [bytes], -1 if nowhere."""
        latched = contents.next_chunk(0)
        first = next((found.stored for found in scan(contents) if found.readable), None)
        try:
            if self._config is not None:
                self._result.channels = _read_channels(contents, self._config)
            if first is not None and first.offset == latched:
                raise DatasetError("latched topics: missing, an episode is here", place=f"byte {latched}")
            if self._result.channels is not None and first is not None:
                start_ns = first.episode.chunk.start_ns
                self._model = McapFile(self._expected.extend, self._result.channels, start_ns=start_ns)
                return self._compare(contents, len(MAGIC), bytes(self._expected[len(MAGIC) :]))
            if latched >= 0:
                return contents.message_indexes(contents.record(latched).end)[1].offset
            for record in contents.records():
                if record.opcode == Opcode.DATA_END:
                    raise DatasetError("no chunk before the data section ends", place=f"byte {record.offset}")
        except DatasetError as error:
            self._report_damage(error)
        # The episodes can still be checked; the damage before the first of them is reported above.
        return first.offset if first else -1

    def _compare(self, contents: McapContents, start: int, expected: bytes) -> int:
        """Compare records with those that should be there; returns where the record after them begins [bytes].

        Args:
            contents: The contents of the file.
            start: Where the records begin [bytes].
            expected: The bytes that should be there.

        Raises:
            DatasetError: If the file ends before they do, or holds records of other kinds.
        """
        offset = start
        for wanted in McapContents(expected).records(0):
            # The closing magic is no record and cannot be read as one.
            if wanted.opcode == Opcode.FOOTER and offset >= len(contents) - len(MAGIC):
                self._report("summary", f"a {wanted.kind} is missing")
                return offset
            actual = contents.record(offset)
            if actual.opcode != wanted.opcode:
                problem = f"a {actual.kind} where a {wanted.kind} should be"
                raise DatasetError(problem, place=f"byte {actual.offset}")
            if actual.data != wanted.data:
                self._report_difference(actual, wanted)
            offset = actual.end
        return offset

    def _report_difference(self, actual: Record, wanted: Record) -> None:
        place = f"byte {actual.offset}"
        if wanted.opcode == Opcode.SCHEMA:
            self._report("schemas", f"that of {wanted.parse(records.Schema).name} is another one")
        elif wanted.opcode == Opcode.CHANNEL:
            self._report("channels", f"are not those of the configuration: {wanted.parse(records.Channel).topic}")
        elif wanted.opcode == Opcode.CHUNK:
            self._report_latched(actual, wanted)
        else:
            other = f"summary: the {actual.kind} does not fit the file"
            self._report(place, _PROBLEMS.get(Opcode(wanted.opcode), other))

    def _report_latched(self, actual: Record, wanted: Record) -> None:
        """Report how the chunk of the latched topics differs from the one that should be there."""
        place = f"byte {actual.offset}"
        try:
            found, expected = read_latched_table(actual), read_latched_table(wanted)
        except DatasetError as error:
            self._report(place, f"latched topics: {error}")
            return
        if found.columns.keys() != expected.columns.keys():
            self._report(place, f"latched topics: the file begins with channels {list(found.columns)}")
            return
        differing = [
            channel.topic
            for channel in Channels.latched
            if found.messages(channel.id).tobytes() != expected.messages(channel.id).tobytes()
        ]
        if differing:
            self._report(place, f"latched topics: {', '.join(differing)} does not fit the robot's description")
        else:
            self._report(place, "latched topics: their times are not that of the first sample")

    def _check_episodes(self, contents: McapContents, start: int) -> int:
        """Check all episodes; returns where the record after the last of them begins, -1 if that is not known.

        Args:
            contents: The contents of the file.
            start: Where the first episode should begin [bytes]; -1 if there is none.
        """
        places: dict[int, int] = {}
        expected = start
        for found in scan(contents, start) if start >= 0 else ():
            stored = found.stored
            if stored.offset < expected or not found.readable:
                # Within the records of an episode that is damaged, or damaged so that its records lead nowhere.
                continue
            if stored.offset > expected:
                self._report_gap(contents, expected, resumed=stored.offset)
            if self._model is not None:
                # The model gets the bytes as they lie here, as its indexes and its CRC are compared with those here.
                self._model.append(replace(stored.run(), data=contents.slice(stored.offset, stored.end)))
                # The bytes of episodes are checked elsewhere, so here only those before and behind them are kept.
                self._expected.clear()
            self._check_place(stored, places)
            expected = stored.end
        if expected < 0:
            return -1
        try:
            record = contents.record(expected)
            if record.opcode == Opcode.METADATA and record.parse(records.Metadata).name == BAG:
                return expected
        except DatasetError:
            pass  # `_report_gap` reports it, as an episode could begin there
        self._report_gap(contents, expected)
        return -1

    def _report_gap(self, contents: McapContents, start: int, *, resumed: int = -1) -> None:
        """Report a stretch of the file in which no episode can be read.

        Args:
            contents: The contents of the file.
            start: Where an episode should begin [bytes].
            resumed: Where the next episode begins [bytes]; -1 if there is none.
        """
        try:
            contents.episode(start)
        except DatasetError as error:
            self._report_damage(error, start=start, resumed=resumed)
        else:
            given_up = DatasetError("so much is damaged that the rest is not looked at", place=f"byte {start}")
            self._report_damage(given_up)

    def _check_place(self, stored: StoredEpisode, places: dict[int, int]) -> None:
        """Check an episode, and that it should come now; `places` has the offsets of earlier ones [bytes]."""
        trial, offset = stored.episode.header.trial, stored.offset
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
            for problem in self._find_problems(stored, self._path.name, self._result.channels):
                self._report(place, problem)
            self._result.digests[trial] = stored.episode.digest
            if self._waiting is not None:
                self._waiting.remove(trial)
        places.setdefault(trial, offset)

    def _check_magic(self, contents: McapContents) -> bool:
        ends = contents.slice(len(contents) - len(MAGIC), len(contents)) == MAGIC
        if not ends:
            self._report(f"byte {len(contents) - len(MAGIC)}", "the file does not end as an MCAP file does")
        return ends

    def _check_footer(self, contents: McapContents) -> None:
        """Check only the CRC of the summary, as nobody knows the contents that it should have.

        Raises:
            DatasetError: If the file does not end with a footer.
        """
        if not self._check_magic(contents) or len(contents) < len(MAGIC) + len(_FOOTER):
            return
        footer = contents.record(len(contents) - len(MAGIC) - len(_FOOTER))
        if footer.opcode != Opcode.FOOTER or len(footer.data) != len(_FOOTER):
            raise DatasetError(f"a {footer.kind} where the footer should be", place=f"byte {footer.offset}")
        said = footer.parse(records.Footer)
        # The CRC does not cover its own four bytes.
        if said.summary_crc != _crc(contents, said.summary_start, footer.end - 4):
            self._report(f"byte {footer.offset}", "summary: its CRC differs from its contents")


def _crc(contents: McapContents, start: int, end: int) -> int:
    crc = 0
    for block in range(start, end, _CRC_BLOCK):
        crc = crc32(contents.slice(block, min(block + _CRC_BLOCK, end)), crc)
    return crc


def _read_channels(contents: McapContents, config: Config) -> Channels:
    """Read what is recorded, for the robot that the file describes; for the installed one if that is not readable."""
    try:
        return Channels(config, contents.read_robot_description())
    except (KeyError, ValueError, ThrowcollectError):
        # It differs from what the installed robot gives, so it is reported when the two are compared.
        return Channels(config, full_description(config))
