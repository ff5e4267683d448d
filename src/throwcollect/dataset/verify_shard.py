"""Checks one MCAP file of a dataset: that it is, byte for byte, what the writer makes of its episodes.

The episodes are found by `scan`. All else in the file follows from them and from what is recorded, so it is written
once more, as the writer of the file does, and compared record by record.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from isal.isal_zlib import crc32
from mcap import records
from mcap.opcode import Opcode

from throwcollect.config.schema import Config
from throwcollect.dataset.bag import FileSummary
from throwcollect.dataset.directory import LIBRARY, THROWS
from throwcollect.dataset.findings import Finding
from throwcollect.dataset.mcap_file import BAG, MAGIC, PROFILE, McapFile
from throwcollect.dataset.mcap_reader import McapContents, McapRecord, StoredEpisode, map_file, read_latched_table
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
    """Check one file; everything that is wrong with it is a finding, and never an error.

    Args:
        path: The file.
        config: Configuration of the dataset; None if it is not known, and then only episodes and checksums are checked.
        trials: Trials whose episodes the file should hold, in order; None if they are not known.
        find_problems: Finds what is wrong with an episode.
    """
    report = ShardReport()
    try:
        with map_file(path) as contents:
            waiting = None if trials is None else dict.fromkeys(trials)
            _ShardCheck(path.name, contents, config, waiting, find_problems, report).run()
    except DatasetError as error:
        report.findings.append(Finding.of(path.name, error))
    except MemberError:
        raise
    except ThrowcollectError as error:
        report.findings.append(Finding(path.name, "", str(error)))
    return report


@dataclass
class _ShardCheck:
    """Checks the contents of one file once, and fills in the result; see `check_shard`.

    `waiting` are the trials whose episodes have not come yet; `places` has the offsets [bytes] of those that have come,
    by trial, and `latest` is the highest of these trials. `model` writes the file once more into `expected`.
    """

    name: str
    contents: McapContents
    config: Config | None
    waiting: dict[int, None] | None
    find_problems: FindProblems
    result: ShardReport
    damaged: bool = False
    expected: list[bytes] = field(default_factory=list)
    model: McapFile | None = None
    places: dict[int, int] = field(default_factory=dict)
    latest: int = -1

    def _report(self, place: str, problem: str) -> None:
        self.result.findings.append(Finding(self.name, place, problem))

    def _report_damage(self, error: DatasetError, *, start: int | None = None, resumed: int = -1) -> None:
        """Report that records cannot be read.

        They begin at `start` [bytes] if the error does not say where, and the next episode at `resumed`; -1 if there is
        none.
        """
        self.damaged = True
        place = error.place if start is None else f"byte {start}"
        problem = error.details if error.place == place else f"{error.place}: {error.details}"
        self._report(place, problem + (f"; the next episode is at byte {resumed}" if resumed >= 0 else ""))

    def run(self) -> None:
        """Check everything."""
        contents = self.contents
        if len(contents) < len(MAGIC):
            raise DatasetError(f"has {len(contents)} bytes: the file is cut off")
        if contents.slice(0, len(MAGIC)) != MAGIC:
            self._report("byte 0", "the file does not begin as an MCAP file does")
        start = self._check_opening()
        end = self._check_episodes(start)
        for trial in self.waiting or ():
            self._report(f"trial {trial}", f"{THROWS} places an episode here, but the file has no whole one")
        try:
            if self.damaged or self.model is None:
                self._check_footer()
            else:
                # From here on, the model writes what follows the last episode.
                self.expected.clear()
                summary = self.model.finish(self.name)
                self._compare(end, b"".join(self.expected)[: -len(MAGIC)])
                self._check_magic()
                if len(contents) != self.model.size:
                    self._report("", f"has {len(contents)} bytes, its records have {self.model.size}")
                self.result.summary = summary
        except DatasetError as error:
            self._report_damage(error)

    def _check_opening(self) -> int:
        """Check everything before the first episode; returns where that should begin [bytes], -1 if nowhere."""
        contents = self.contents
        latched = contents.next_chunk(0)
        first = next((found.stored for found in scan(contents) if found.readable), None)
        try:
            if self.config is not None:
                self.result.channels = _read_channels(contents, self.config)
            if first is not None and first.offset == latched:
                raise DatasetError("latched topics: missing, an episode is here", place=f"byte {latched}")
            if self.result.channels is not None and first is not None:
                start_ns = first.episode.chunk.start_ns
                self.model = McapFile(self.expected.append, self.result.channels, start_ns=start_ns)
                return self._compare(len(MAGIC), b"".join(self.expected)[len(MAGIC) :])
            if latched >= 0:
                return contents.message_indexes(contents.record(latched).end)[1].offset
            for record in contents.records():
                if record.opcode == Opcode.DATA_END:
                    raise DatasetError("no chunk before the data section ends", place=f"byte {record.offset}")
        except DatasetError as error:
            self._report_damage(error)
        # The episodes can still be checked; the damage before the first of them is reported above.
        return first.offset if first else -1

    def _compare(self, start: int, expected: bytes) -> int:
        """Compare the records from `start` on with those that should be there; returns where they end [bytes]."""
        offset = start
        for wanted in McapContents(expected).records(0):
            # The closing magic is no record and cannot be read as one.
            if wanted.opcode == Opcode.FOOTER and offset >= len(self.contents) - len(MAGIC):
                self._report("summary", f"a {wanted.kind} is missing")
                return offset
            actual = self.contents.record(offset)
            if actual.opcode != wanted.opcode:
                problem = f"a {actual.kind} where a {wanted.kind} should be"
                raise DatasetError(problem, place=f"byte {actual.offset}")
            if actual.data != wanted.data:
                self._report_difference(actual, wanted)
            offset = actual.end
        return offset

    def _report_difference(self, actual: McapRecord, wanted: McapRecord) -> None:
        place = f"byte {actual.offset}"
        if wanted.opcode == Opcode.SCHEMA:
            self._report("schemas", f"the schema of {wanted.parse(records.Schema).name} is another one")
        elif wanted.opcode == Opcode.CHANNEL:
            self._report("channels", f"are not those of the configuration: {wanted.parse(records.Channel).topic}")
        elif wanted.opcode == Opcode.CHUNK:
            self._report_latched(actual, wanted)
        else:
            other = f"summary: the {actual.kind} does not fit the file"
            self._report(place, _PROBLEMS.get(Opcode(wanted.opcode), other))

    def _report_latched(self, actual: McapRecord, wanted: McapRecord) -> None:
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

    def _check_episodes(self, start: int) -> int:
        """Check all episodes, of which the first should begin at `start` [bytes]; -1 if there is none.

        Returns:
            Where the record after the last of them begins [bytes]; -1 if that is not known.
        """
        contents, expected = self.contents, start
        for found in scan(contents, start) if start >= 0 else ():
            stored = found.stored
            if stored.offset < expected or not found.readable:
                # It lies within the records of a damaged episode, or its own records do not follow each other.
                continue
            if stored.offset > expected:
                self._report_gap(expected, resumed=stored.offset)
            if self.model is not None:
                # The model gets the bytes as they are in the file, whose indexes and CRC are compared with the model's.
                self.model.append(stored.intact_run if found.intact else stored.run())
                # The bytes of episodes are checked elsewhere, so here only those before and behind them are kept.
                self.expected.clear()
            self._check_place(stored)
            expected = stored.end
        if expected < 0:
            return -1
        try:
            record = contents.record(expected)
            if record.opcode == Opcode.METADATA and record.parse(records.Metadata).name == BAG:
                return expected
        except DatasetError:
            pass  # `_report_gap` reports it, as an episode could begin there
        self._report_gap(expected)
        return -1

    def _report_gap(self, start: int, *, resumed: int = -1) -> None:
        """Report that no episode can be read from `start` on; the next one begins at `resumed` [bytes], -1 if none."""
        reason = DatasetError("so much is damaged that the rest is not looked at", place=f"byte {start}")
        try:
            self.contents.episode(self.contents.record(start))
        except DatasetError as error:
            reason = error
        self._report_damage(reason, start=start, resumed=resumed)

    def _check_place(self, stored: StoredEpisode) -> None:
        """Check an episode, and that it is expected at this place."""
        trial, offset = stored.episode.header.trial, stored.offset
        place = f"trial {trial}"
        if trial in self.places:
            earlier = self.places[trial]
            self._report(place, f"byte {offset}: the file has an episode of this trial already, at byte {earlier}")
        elif self.waiting is not None and trial not in self.waiting:
            self._report(place, f"byte {offset}: an episode that {THROWS} does not place here")
        else:
            if trial < self.latest:
                self._report(place, f"byte {offset}: comes after trial {self.latest}")
            for problem in self.find_problems(stored, self.name, self.result.channels):
                self._report(place, problem)
            self.result.digests[trial] = stored.episode.digest
            if self.waiting is not None:
                del self.waiting[trial]
        self.places.setdefault(trial, offset)
        self.latest = max(self.latest, trial)

    def _check_magic(self) -> bool:
        offset = len(self.contents) - len(MAGIC)
        ends = self.contents.slice(offset, len(self.contents)) == MAGIC
        if not ends:
            self._report(f"byte {offset}", "the file does not end as an MCAP file does")
        return ends

    def _check_footer(self) -> None:
        """Check only the CRC of the summary, as it is not known which contents it should have."""
        contents = self.contents
        if not self._check_magic() or len(contents) < len(MAGIC) + len(_FOOTER):
            return
        footer = contents.record(len(contents) - len(MAGIC) - len(_FOOTER))
        if footer.opcode != Opcode.FOOTER or len(footer.data) != len(_FOOTER):
            raise DatasetError(f"a {footer.kind} where the footer should be", place=f"byte {footer.offset}")
        fields = footer.parse(records.Footer)
        # The CRC does not cover its own four bytes.
        if fields.summary_crc != _compute_crc(contents, fields.summary_start, footer.end - 4):
            self._report(f"byte {footer.offset}", "summary: its CRC differs from its contents")


def _compute_crc(contents: McapContents, start: int, end: int) -> int:
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
