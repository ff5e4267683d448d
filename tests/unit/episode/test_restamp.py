from dataclasses import replace

import numpy as np
import pytest
from tests.unit.dataset.conftest import Collection, throw

from throwcollect.episode.channels import Channels
from throwcollect.episode.episode_message import Episode
from throwcollect.episode.record import Contact, ControllerSamples
from throwcollect.episode.recorded_chunk import RecordedChunk
from throwcollect.episode.restamp import Restamper
from throwcollect.errors import DatasetError
from throwcollect.robots.description import full_description
from throwcollect.robots.talos import TALOS

EVERYTHING = ["joint_states", "ball/odometry", "controller_state", "tf", "clock"]


def record_as(collection: Collection, *, as_trial: int) -> Episode:
    """Trial 4 as it would be recorded under the number `as_trial`."""
    samples, header = throw(collection.config, 4)
    by_ns = collection.config.trial_start_ns(as_trial) - header.start_ns
    contacts = tuple(
        Contact(each.body, each.start_ns + by_ns, None if each.end_ns is None else each.end_ns + by_ns)
        for each in (*header.contacts, Contact("ground", int(samples.stamps_ns[-1]), None))
    )
    elapsed = samples.stamps_ns - header.start_ns
    targets = {
        name: ControllerSamples(
            elapsed, *(np.full((len(samples), len(TALOS.controllers[name])), 0.5) for _ in range(4))
        )
        for name in ("arm_right_controller", "torso_controller")
    }
    header = replace(header, trial=as_trial, start_ns=header.start_ns + by_ns, contacts=contacts)
    samples = replace(samples, stamps_ns=samples.stamps_ns + by_ns)
    return Episode(header, collection.encoder.encode(samples, targets)[0])


@pytest.fixture(scope="module")
def collection() -> Collection:
    return Collection({"record": {"topics": EVERYTHING}})


@pytest.fixture(scope="module")
def restamper(collection: Collection) -> Restamper:
    return Restamper(collection.config, Channels(collection.config, full_description(collection.config)))


@pytest.mark.parametrize("number", [0, 4, 9_999_999])
def test_an_episode_restamped_to_another_trial_equals_one_recorded_as_that_trial(
    number: int, collection: Collection, restamper: Restamper
) -> None:
    moved, expected = (
        restamper.restamp(record_as(collection, as_trial=4), number),
        record_as(collection, as_trial=number),
    )
    assert moved.header == expected.header
    assert moved.chunk == expected.chunk
    assert moved.digest == expected.digest
    moved.check_records()
    assert np.array_equal(moved.samples().stamps_ns, expected.samples().stamps_ns)


def test_restamping_does_not_change_the_original_episode(collection: Collection, restamper: Restamper) -> None:
    episode, untouched = record_as(collection, as_trial=4), record_as(collection, as_trial=4)
    restamper.restamp(episode, 0)
    assert episode.state.contents == untouched.state.contents
    assert episode.header == untouched.header


def test_restamping_an_episode_with_a_wrong_hash_is_refused(collection: Collection, restamper: Restamper) -> None:
    episode = record_as(collection, as_trial=4)
    forged = Episode(episode.header, RecordedChunk(episode.chunk, "0" * 64))
    with pytest.raises(DatasetError, match="SHA-256 of its records"):
        restamper.restamp(forged, 0)


def test_restamping_an_episode_of_other_topics_is_refused(restamper: Restamper) -> None:
    with pytest.raises(DatasetError, match="has the channels"):
        restamper.restamp(Collection().episode(4), 0)
