"""Episodes with a second chunk, such as images of a camera: all commands keep it, and digests stay the same."""

from __future__ import annotations

import io
from collections.abc import Callable
from contextlib import closing
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import zstandard
from mcap import records
from mcap.reader import make_reader
from tests.unit.dataset.conftest import Collection
from tests.unit.dataset.damage import find_stored, flip
from tests.unit.dataset.mutations import finish, fit_manifest

from rclzenoh.interfaces import deserialize, get_message, serialize
from throwcollect.dataset.creation import create
from throwcollect.dataset.inspect import digest, info
from throwcollect.dataset.mcap_file import EPISODE
from throwcollect.dataset.mcap_reader import open_mcap
from throwcollect.dataset.reader import Dataset
from throwcollect.dataset.recovery import remove_unfinished
from throwcollect.dataset.verify import verify
from throwcollect.dataset.writer import DatasetWriter
from throwcollect.derive.selection import sample
from throwcollect.episode import channels as declared
from throwcollect.episode.channels import Channel, Qos
from throwcollect.episode.chunk import encode_records
from throwcollect.episode.episode_message import Delivery, Episode, pack, unpack
from throwcollect.episode.recorded_chunk import RecordedChunk
from throwcollect.run_key import Signer

CAMERA, TOUCH = 100, 101
TYPE = "sensor_msgs/msg/CompressedImage"
SHARD = "quick_00001.mcap"
RATE_HZ = 30


@pytest.fixture(autouse=True)
def camera(monkeypatch: pytest.MonkeyPatch) -> None:
    qos = Qos("volatile", 10)
    both = (Channel(CAMERA, "/camera/image/compressed", TYPE, qos), Channel(TOUCH, "/touch/compressed", TYPE, qos))
    monkeypatch.setattr(declared, "SENSORS", [both])


def image(stamp_ns: int, size: int) -> bytes:
    sec, nanosec = divmod(stamp_ns, 1_000_000_000)
    stamp = get_message("builtin_interfaces/msg/Time")(sec=sec, nanosec=nanosec)
    header = get_message("std_msgs/msg/Header")(stamp=stamp, frame_id="camera")
    data = np.random.default_rng(size).integers(0, 256, size, np.uint8)
    return bytes(serialize(get_message(TYPE)(header=header, format="jpeg", data=data)))


def add_images(episode: Episode, change: Callable[[list[records.Message]], None] = lambda _: None) -> Episode:
    """The episode with images of varying size at the camera's rate, and a few of the other sensor."""
    start, end = episode.chunk.start_ns, episode.chunk.end_ns
    messages, counts = [], {CAMERA: 0, TOUCH: 0}
    for number, stamp in enumerate(range(start, end + 1, 1_000_000_000 // RATE_HZ)):
        for channel in (CAMERA, TOUCH)[: 1 + (number % 7 == 0)]:
            data = image(stamp, 1000 + 37 * number + episode.header.trial)
            messages.append(records.Message(channel, stamp, data, stamp, counts[channel]))
            counts[channel] += 1
    change(messages)
    contents = encode_records(*messages)
    data = zstandard.ZstdCompressor(level=1).compress(contents)
    images = RecordedChunk.of(contents, data, start_ns=start, end_ns=messages[-1].log_time)
    return Episode(episode.header, episode.state, images)


class Filmed(Collection):
    """A collection with a camera."""

    def episode(self, trial: int, change: Any = None) -> Episode:
        return add_images(super().episode(trial, change))


@pytest.fixture
def dataset(tmp_path: Path) -> Path:
    return Filmed().collect(tmp_path / "dataset")


def test_the_message_of_an_episode_carries_its_sensor_chunk(collection: Collection) -> None:
    signer = Signer(b"key of the run")
    sent = add_images(collection.episode(2))
    arrived = unpack(pack(Delivery(sent, "", ""), signer), signer).episode
    assert [each.chunk for each in arrived.chunks] == [each.chunk for each in sent.chunks]
    assert arrived.digest == sent.digest == collection.episode(2).digest


def test_sensors_do_not_change_the_digests_of_throws_and_dataset(dataset: Path, collected: Path) -> None:
    with_camera, without = Dataset.open(dataset), Dataset.open(collected)
    assert with_camera.throws["digest"].equals(without.throws["digest"])
    assert digest(dataset) == digest(collected) == with_camera.digest
    state = next(with_camera.episodes()).state
    assert state.chunk == next(without.episodes()).state.chunk
    assert np.array_equal(with_camera[4].ball.position, without[4].ball.position)


def test_the_mcap_package_reads_the_images_of_a_sensor(dataset: Path) -> None:
    topics = ("/camera/image/compressed", "/touch/compressed")
    counts = dict.fromkeys(topics, 0)
    for path in sorted(dataset.glob("*.mcap")):
        with path.open("rb") as file:
            found = [
                (channel, message) for _, channel, message in make_reader(file, validate_crcs=True).iter_messages()
            ]
        for topic in topics:
            counts[topic] += sum(channel.topic == topic for channel, _ in found)
        images = [deserialize(message.data, get_message(TYPE)) for channel, message in found if channel.topic in topics]
        assert len({each.data.size for each in images}) > 30
        assert all(each.format == "jpeg" for each in images)
    assert counts == {topic: info(dataset).topics[topic] for topic in topics}
    assert counts[topics[0]] > counts[topics[1]] > 0


def test_a_dataset_with_sensors_has_no_findings(dataset: Path) -> None:
    assert verify(dataset) == []


@pytest.mark.parametrize(("begin", "problem"), [(60, "chunk: "), (9 + 24, "CRC differs")])
def test_a_damaged_sensor_chunk_is_found_and_loses_its_episode(dataset: Path, begin: int, problem: str) -> None:
    flip(dataset / SHARD, find_stored(dataset / SHARD, 4).chunks[1].record.offset + begin)
    fit_manifest(dataset)
    assert any((finding.place, problem in finding.problem) == ("trial 4", True) for finding in verify(dataset))
    (dataset / "metadata.yaml").unlink()
    finish(dataset)
    assert [row["trial"] for row in Dataset.open(dataset).throws.to_pylist() if row["outcome"] == "lost"] == [4]
    assert verify(dataset) == []


def test_resume_restores_damaged_indexes_of_a_sensor_chunk(dataset: Path) -> None:
    whole = (dataset / SHARD).read_bytes()
    flip(dataset / SHARD, find_stored(dataset / SHARD, 4).chunks[1].indexes[CAMERA].offset + 30)
    fit_manifest(dataset)
    (finding,) = (finding for finding in verify(dataset) if finding.file == SHARD and finding.place == "trial 4")
    assert "message indexes" in finding.problem
    flip(dataset / SHARD, find_stored(dataset / SHARD, 4).chunks[1].indexes[CAMERA].offset + 1)
    finish(dataset)
    assert (dataset / SHARD).read_bytes() == whole


def without_one(messages: list[records.Message]) -> None:
    del messages[2]


def late(messages: list[records.Message]) -> None:
    messages[-1].log_time += 10_000_000_000


def swap_messages(messages: list[records.Message]) -> None:
    messages[2:4] = messages[3:1:-1]


def other_stamp(messages: list[records.Message]) -> None:
    messages[3].data = image(messages[2].log_time, 10)


def of_joint_states(messages: list[records.Message]) -> None:
    messages[3].channel_id = 3


@pytest.mark.parametrize(
    ("change", "problem"),
    [
        (without_one, "are not numbered from 0"),
        (late, "the trial ends at"),
        (swap_messages, "not in order of their times"),
        (other_stamp, "stamps differ"),
        (of_joint_states, "has the channels"),
    ],
)
def test_messages_that_a_sensor_cannot_have_recorded_are_found(
    tmp_path: Path, change: Callable[[list[records.Message]], None], problem: str
) -> None:
    class Changed(Collection):
        def episode(self, trial: int, change_samples: Any = None) -> Episode:
            return add_images(super().episode(trial), change if trial == 4 else lambda _: None)

    findings = verify(Changed({"trials": 5}).collect(tmp_path / "dataset"))
    assert findings
    assert {finding.place for finding in findings} == {"trial 4"}
    assert any(problem in finding.problem for finding in findings), findings


def test_a_killed_collection_with_sensors_resumes_to_the_same_files(dataset: Path, tmp_path: Path) -> None:
    collection, begun = Filmed(), tmp_path / "begun"
    create(begun, collection.plan)
    with closing(DatasetWriter.open(begun)) as writer:
        collection.fill(writer, [0, 1, 4, 3])
    part = begun / f"{SHARD}.part"
    part.write_bytes(part.read_bytes()[:-1000])
    remove_unfinished(begun)
    with closing(DatasetWriter.open(begun)) as writer:
        kept: list[int] = []
        writer.recover(lambda trial, _: kept.append(trial) is None)
        assert kept == [0, 1, 4]
        collection.fill(writer, [6, 5, 3, 2])
        writer.finish()
    for path in dataset.glob("*.mcap"):
        assert (begun / path.name).read_bytes() == path.read_bytes()


def test_a_derived_dataset_has_the_sensor_messages_of_its_sources(dataset: Path, tmp_path: Path) -> None:
    sample(dataset, tmp_path / "some", count=3)
    assert verify(tmp_path / "some") == []
    some = Dataset.open(tmp_path / "some")
    for throw in some:
        (copied,), (original,) = some.episode(throw.trial).sensors, Dataset.open(dataset).episode(throw.trial).sensors
        assert copied.chunk == original.chunk


def test_a_recording_without_sensors_has_no_metadata_of_sensors(
    collected: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(declared, "SENSORS", [])
    with open_mcap(collected / SHARD) as contents:
        (facts, *_) = [record for record in contents.records() if EPISODE.encode() in record.data]
    metadata = facts.parse(records.Metadata).metadata
    assert list(metadata) == ["trial", "digest", "records_sha256", "header"]
    assert io.BytesIO(facts.data).read(1) == b"\x0c"
