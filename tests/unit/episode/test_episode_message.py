from __future__ import annotations

import hashlib
from dataclasses import replace
from typing import Any
from unittest.mock import Mock

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rclzenoh.interfaces import deserialize, get_message
from throwcollect.config.schema import Config
from throwcollect.episode.channels import Channels
from throwcollect.episode.chunk import Chunk
from throwcollect.episode.episode_message import (
    Episode,
    TrialRefusal,
    header_from_json,
    header_to_json,
    pack,
    unpack,
)
from throwcollect.episode.message_table import ChunkEncoder
from throwcollect.episode.record import EpisodeHeader
from throwcollect.errors import DatasetError
from throwcollect.robots.description import full_description
from throwcollect.run_key import Signer

SIGNER = Signer(b"key of the run")
RESULT = '{"outcome": "landed"}'
CONDITIONS = '{"ball.mass_kg": 0.05}'


@pytest.fixture(scope="module")
def encoder() -> ChunkEncoder:
    return ChunkEncoder(Channels(Config(), full_description(Config())), level=1)


@pytest.fixture
def sent(encoder: ChunkEncoder, header: EpisodeHeader, make_samples: Any) -> Episode:
    return Episode(header, encoder.encode(make_samples(50))[0], result=RESULT, conditions=CONDITIONS)


def test_an_episode_arrives_as_it_was_sent(sent: Episode, make_samples: Any) -> None:
    episode = unpack(pack(sent, SIGNER), SIGNER)
    assert isinstance(episode, Episode)
    assert (episode.result, episode.conditions) == (RESULT, CONDITIONS)
    assert (episode.header, episode.chunk) == (sent.header, sent.chunk)
    assert episode.digest == sent.digest
    assert episode.samples().object_position.tolist() == make_samples(50).object_position.tolist()


def test_the_message_of_an_episode_is_a_standard_array_that_names_its_parts(sent: Episode) -> None:
    message = deserialize(pack(sent, SIGNER), get_message("std_msgs/msg/UInt8MultiArray"))
    sizes = {part.label: part.size for part in message.layout.dim}
    assert list(sizes) == ["header", "result", "conditions", "hash", "chunk", "signature"]
    data, parts = message.data.tobytes(), {}
    for name, size in sizes.items():
        parts[name], data = data[:size], data[size:]
    assert header_from_json(parts["header"]) == sent.header
    assert parts["result"].decode() == RESULT
    assert parts["conditions"].decode() == CONDITIONS
    assert parts["hash"].hex() == sent.chunk.records_sha256
    assert parts["chunk"] == sent.chunk.record() + b"".join(sent.table.message_indexes.values())
    assert SIGNER.has_signed(parts.pop("signature").decode(), *parts.values())


def test_message_indexes_come_with_an_episode_so_that_its_chunk_is_not_decompressed(
    sent: Episode, monkeypatch: pytest.MonkeyPatch
) -> None:
    from_contents = Episode(sent.header, replace(sent.chunk, indexes={})).message_indexes
    message = pack(sent, SIGNER)
    monkeypatch.setattr(Chunk, "decompress", Mock(side_effect=AssertionError))
    assert unpack(message, SIGNER).message_indexes == from_contents


def test_the_digest_covers_header_and_records_but_not_their_compression(
    encoder: ChunkEncoder, header: EpisodeHeader, sent: Episode, make_samples: Any
) -> None:
    records = hashlib.sha256(sent.chunk.decompress()).digest()
    assert sent.digest == hashlib.sha256(header_to_json(header).encode() + b"\0" + records).hexdigest()
    packer = ChunkEncoder(Channels(Config(), full_description(Config())), level=9)
    packed_more = Episode(header, packer.encode(make_samples(50))[0])
    assert packed_more.chunk.data != sent.chunk.data
    assert packed_more.digest == sent.digest
    others = [
        Episode(replace(header, end_reason="rest"), sent.chunk),
        Episode(replace(header, contacts=header.contacts[:1]), sent.chunk),
        Episode(replace(header, goals=()), sent.chunk),
        Episode(header, encoder.encode(make_samples(50, seed=1))[0]),
    ]
    assert len({sent.digest, *(other.digest for other in others)}) == 5


def test_a_hash_that_is_not_that_of_the_records_is_an_error(sent: Episode) -> None:
    sent.chunk.check_records()
    with pytest.raises(DatasetError, match="SHA-256 of its records is"):
        Episode(sent.header, replace(sent.chunk, records_sha256="0" * 64)).chunk.check_records()


def test_a_header_survives_json_unchanged(header: EpisodeHeader) -> None:
    text = header_to_json(header)
    assert text.startswith('{"trial":7,"start_ns":10000000000,"end_reason":"landed","contacts":[{"body":"spoon",')
    assert header_to_json(header_from_json(text)) == text


def test_padding_after_a_message_is_ignored(sent: Episode) -> None:
    assert unpack(pack(sent, SIGNER) + bytes(3), SIGNER).chunk == sent.chunk


@pytest.fixture(scope="module")
def whole(encoder: ChunkEncoder, header: EpisodeHeader, make_samples: Any) -> bytes:
    chunk = encoder.encode(make_samples(3))[0]
    episode = Episode(replace(header, samples=3), chunk, result=RESULT, conditions=CONDITIONS)
    return pack(episode, SIGNER)


@settings(max_examples=300)
@given(data=st.data())
def test_a_randomly_changed_message_is_refused_with_a_dataset_error(whole: bytes, data: st.DataObject) -> None:
    """A changed byte or stretch gives a DatasetError, unless it is part of nothing that is read."""
    message = bytearray(whole)
    if data.draw(st.booleans()):
        message[data.draw(st.integers(0, len(message) - 1))] ^= data.draw(st.integers(1, 255))
    else:
        start = data.draw(st.integers(0, len(message)))
        message[start : data.draw(st.integers(start, len(message)))] = data.draw(st.binary(max_size=200))
    try:
        delivery = unpack(bytes(message), SIGNER)
    except DatasetError:
        return
    sent = unpack(whole, SIGNER)
    assert isinstance(delivery, Episode)
    assert isinstance(sent, Episode)
    assert (delivery.digest, delivery.conditions, delivery.result) == (sent.digest, CONDITIONS, RESULT)


def test_a_refusal_arrives_as_it_was_sent() -> None:
    refusal = TrialRefusal(7, "zu schnell für den Ellbogen")
    assert unpack(pack(refusal, SIGNER), SIGNER) == refusal
    with pytest.raises(DatasetError, match="signed"):
        unpack(pack(refusal, Signer(b"another")), SIGNER)
    with pytest.raises(DatasetError, match="cannot be read"):
        unpack(pack(TrialRefusal("seven", "no"), SIGNER), SIGNER)  # type: ignore[arg-type]


def test_an_episode_signed_with_another_key_is_refused(sent: Episode) -> None:
    with pytest.raises(DatasetError, match="episode: is not signed with the key of this run"):
        unpack(pack(sent, Signer(b"another")), SIGNER)
